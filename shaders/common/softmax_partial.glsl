// A softmax over some rows, relative to their largest logit, and the sums of four columns it weights.
#ifndef BITR_SOFTMAX_PARTIAL
#define BITR_SOFTMAX_PARTIAL

struct Partial {
  vec4 sums;
  float largest;
  float total;
};

// Finite, so that the difference of two such is a number.
Partial no_rows() { return Partial(vec4(0), -3.4e38, 0.0); }

Partial join(Partial a, Partial b) {
  const float largest = max(a.largest, b.largest);
  const float scale_a = exp(a.largest - largest), scale_b = exp(b.largest - largest);
  return Partial(a.sums * scale_a + b.sums * scale_b, largest, a.total * scale_a + b.total * scale_b);
}

#endif
