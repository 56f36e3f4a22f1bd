// The matrices of a one-sided layer. Needs weights[], coefficients[], PER_CLOUD, COEFFICIENT_STRIDE, DEGREE0.
// An invocation's cloud is its subgroup's: where numbers of storage buffers are slow (TEXELS, common/texels.glsl), each
// loads one in eight of the matrices that come per cloud, and they are handed round.

uint cloud;

float weight1(int i) { return weights[i / 4][i % 4]; }
float weight0(int i) { return PER_CLOUD ? coefficients[cloud * COEFFICIENT_STRIDE + i] : weight1(DEGREE0 + i); }

// float row[n]: those of degree 0 from `first` on. Where all invocations meet.
#ifdef TEXELS
#define WEIGHTS0(row, first, n)                                                                                   \
  float row##_parts[((n) + 7) / 8], row[n];                                                                       \
  [[unroll]] for (int i = 0; i < ((n) + 7) / 8; ++i)                                                              \
    row##_parts[i] = PER_CLOUD ? weight0((first) + min(8 * i + int(gl_SubgroupInvocationID & 7u), (n) - 1)) : 0.0; \
  [[unroll]] for (int i = 0; i < (n); ++i)                                                                        \
    row[i] = PER_CLOUD ? subgroupShuffle(row##_parts[i / 8], i % 8) : weight0((first) + i);
#else
#define WEIGHTS0(row, first, n) \
  float row[n];                 \
  [[unroll]] for (int i = 0; i < (n); ++i) row[i] = weight0((first) + i);
#endif
