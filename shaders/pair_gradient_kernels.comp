// pair_gradient_kernels.comp: the gradient of a part of a two-sided kernel (one degree in, one out) in the edges' frames:
// of its radial coefficients, of the features it reads, and of the lengths; an invocation per edge, in their order, and
// part. A dispatch takes parts alike: N1 and N2 components on the two sides, 3 from degree 1 to 1 and 1 otherwise.
// in  0 turned   f32[16·IN4,E,4]  features in the frames: common/pair_record.glsl
// in  1 d_turned f32[M,E]         gradients of the messages in the frames
// in  2 factors  f32[TABLES+1,E,4] of the tables' columns; the lengths
// in  3 ids      u32[TABLES,E]    of the sectors
// in  4 sectors  f32[S,4]         common/pair_tables.glsl
// con 5 heads    u32[TABLES,12]   the same
// con 6 blocks   u32[PARTS,8]     first component in, first number out, channels out, numbers of a channel out + 256 ·
//                                 those of one component of the first side; vec4 in coefficients[] and in d_features[],
//                                 first table, 1 and 2: degrees differ on a side
// out 7 d_coefficients f32[D,E,4] frequency, channels in, channels out
// out 8 d_features f32[W,E,4]     part, channels in, component
// out 9 d_radial f32[TABLES,E,4]  gradients of both lengths, of the second and of the first variance
// spec 0 WORKGROUP=32  1 N1≤3  2 N2≤3  3–6 IN  7–10 VALUES  11–14 KEYS  15 LINEAR  16 SEARCH  17 PER_PART≤2
//      18 PARTS
// grid (ceil(E / WORKGROUP), parts) | shared 0 KiB
// loops ≤ IN4·(1 + channels out·(1 + 2·32·3)) < 65535 | error: see src/ops/gradient.hpp | fp32
#version 450
#extension GL_EXT_control_flow_attributes : require
#extension GL_GOOGLE_include_directive : require
#ifdef TEXELS
#define SHUFFLE
#endif
#ifdef SHUFFLE
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_shuffle : require
#endif
#include "common/pair_layer.glsl"
#include "common/parameters.glsl"
#include "common/pair_record.glsl"
#include "common/texels.glsl"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const int N1 = 3;
layout(constant_id = 2) const int N2 = 3;
layout(constant_id = 17) const int PER_PART = 2;  // tables of a part
layout(constant_id = 18) const int PARTS = 16;

READ_VEC4S(0, Turned);
layout(set = 0, binding = 1) readonly buffer DTurned { float d_turned[]; };
READ_VEC4S(2, Factors);
layout(set = 0, binding = 3) readonly buffer Ids { uint ids[]; };
READ_VEC4S(4, Sectors);
layout(set = 0, binding = 5) uniform Heads { uvec4 heads[3 * TABLES]; };
layout(set = 0, binding = 6) uniform Blocks { uvec4 blocks[2 * PARTS]; };
layout(set = 0, binding = 7) writeonly buffer DCoefficients { vec4 d_coefficients[]; };
layout(set = 0, binding = 8) writeonly buffer DFeatures { vec4 d_features[]; };
layout(set = 0, binding = 9) writeonly buffer DRadial { vec4 d_radial[]; };
layout(push_constant) uniform Push { PairGradientParameters p; };
#include "common/pair_columns.glsl"

const float DIRECTION_EPS = 1e-12;  // ops::direction_eps
const uint SWAPPED = 1u, DEGREE1 = 2u;
const int N = N1 * N2;

// Directions shorter than their floor, as src/ops/pair_attention.hpp has it.
vec4 coefficient[N], d_coefficient[N];

void shorten(vec2 norm, bool differs1, bool differs2) {
  [[unroll]] for (int side = 0; side < 2; ++side) {
    const float n = norm[side];
    const int count = side == 0 ? N1 : N2, step = side == 0 ? N2 : 1, others = side == 0 ? N2 : N1;
    const int other_step = side == 0 ? 1 : N2;
    if (count == 3) {
      [[unroll]] for (int i = 0; i < others; ++i) {
        const int at = i * other_step;
        const vec4 scalar = (coefficient[at] + 2.0 * coefficient[at + step]) / 3.0;
        if (n < 1.0) {
          coefficient[at] = mix(scalar, coefficient[at], n * n);
          coefficient[at + step] = mix(scalar, coefficient[at + step], n * n);
          coefficient[at + 2 * step] *= n;
        }
      }
    } else if (side == 0 ? differs1 : differs2) {
      [[unroll]] for (int i = 0; i < N; ++i) coefficient[i] *= n;
    }
  }
}

void shorten_gradient(vec2 norm, bool differs1, bool differs2) {
  [[unroll]] for (int side = 0; side < 2; ++side) {
    const float n = norm[side];
    const int count = side == 0 ? N1 : N2, step = side == 0 ? N2 : 1, others = side == 0 ? N2 : N1;
    const int other_step = side == 0 ? 1 : N2;
    if (count == 3) {
      [[unroll]] for (int i = 0; i < others; ++i) {
        const int at = i * other_step;
        const vec4 scalar = (1.0 - n * n) / 3.0 * (d_coefficient[at] + d_coefficient[at + step]);
        if (n < 1.0) {
          d_coefficient[at] = n * n * d_coefficient[at] + scalar;
          d_coefficient[at + step] = n * n * d_coefficient[at + step] + 2.0 * scalar;
          d_coefficient[at + 2 * step] *= n;
        }
      }
    } else if (side == 0 ? differs1 : differs2) {
      [[unroll]] for (int i = 0; i < N; ++i) d_coefficient[i] *= n;
    }
  }
}

// b: the gradient's products with the table's columns.
vec4 radial_gradient(uint table, vec3 b, vec2 lengths, vec4 x, uint at) {
  const uvec4 head = heads[3 * table];
  const bool swapped = (head.w & SWAPPED) != 0u;
  if ((head.w & DEGREE1) != 0u) return vec4(swapped ? b.yx : b.xy, 0, 0);
  const vec4 form = uintBitsToFloat(heads[3 * table + 1]), Q = VEC4_OF(Sectors, at - 2u);
  const vec2 Q1 = VEC4_OF(Sectors, at - 1u).xy, r = swapped ? lengths.yx : lengths;
  const float scale = 1.0 / sqrt(form.x * r.x * r.x + form.y * r.x * r.y + form.z * r.y * r.y + form.w);
  const vec2 u = r * scale;
  const float v = x.z;
  const float d_second = -0.5 * v * v * v * (u.x * b.x + u.y * b.y + b.z);
  const vec2 d_u = v * b.xy + d_second * vec2(2.0 * Q.x * u.x + Q.y * u.y + Q.w, Q.y * u.x + 2.0 * Q.z * u.y + Q1.x);
  const float d_first = -0.5 * scale * scale * scale * dot(d_u, r);
  const vec2 d_r =
      d_u * scale + d_first * vec2(2.0 * form.x * r.x + form.y * r.y, form.y * r.x + 2.0 * form.z * r.y);
  return x.w > 0.0 ? vec4(swapped ? d_r.yx : d_r, d_second, d_first) : vec4(0);
}

vec4 x[PER_PART];
uint at[PER_PART];
vec3 products[PER_PART];
bool linear[PER_PART];

// What table t adds to the coefficients, and the gradient's products with its columns.
void add_columns(const int t, uint shift, uint step) {
  const uint first = at[t] + shift;
  first_sector(first);
  do {
    const float here = first == sector ? 1.0 : 0.0;
    int pair = 0;  // the pair of columns
    do {
      const vec2 factor = here * (pair == 0 ? x[t].xy : x[t].zw);
      vec2 product = vec2(0);
      [[unroll]] for (int row = 0; row < 2 * N; row += ROWS_AT_ONCE) {
        const LOADED loaded = load_rows(2 * N * pair + row, 2 * N * (pair + 1), step);
        [[unroll]] for (int more = 0; more < ROWS_AT_ONCE; ++more)
          if (row + more < 2 * N) {
            const vec4 weights = row_of(loaded, 2 * N * pair + row, more, step);
            const int f = (row + more) % N, column = (row + more) / N;
            coefficient[f] += factor[column] * weights;
            product[column] += dot(d_coefficient[f], weights);
          }
      }
      products[t] += here * (pair == 0 ? vec3(product, 0) : vec3(0, 0, product.x));
    } while (++pair < (LINEAR && linear[t] ? 1 : 2));
  } while (next_sector(first));
}

void main() {
  const bool inside = gl_GlobalInvocationID.x < p.edges;
  const uint edge = min(gl_GlobalInvocationID.x, p.edges - 1u), part = p.first_block + gl_WorkGroupID.y;
  const uvec4 places = blocks[2 * part], more = blocks[2 * part + 1];
  const uint channels = places.z, dim = places.w & 0xffu, across = places.w >> 8, step = IN4 * channels;
  const bool differs1 = (more.w & 1u) != 0u, differs2 = (more.w & 2u) != 0u;
  const vec2 lengths = VEC4_OF(Factors, TABLES * p.edges + edge).xy, norm = min(lengths / DIRECTION_EPS, 1.0);

  [[unroll]] for (int t = 0; t < PER_PART; ++t) {
    const uint table = more.z + t;
    const uvec4 head = heads[3 * table];
    x[t] = VEC4_OF(Factors, table * p.edges + edge);
    linear[t] = (head.w & DEGREE1) != 0u;
    at[t] = head.y + ids[table * p.edges + edge] * head.z + (linear[t] ? 0u : 2u);
    products[t] = vec3(0);
  }

  for (int c = 0; c < IN4; ++c) {
    vec4 feature[N], d_feature[N];
    [[unroll]] for (int i = 0; i < N; ++i) {
      feature[i] = VEC4_OF(Turned, ((places.x + COMPONENT(i / N2, i % N2)) * IN4 + c) * p.edges + edge);
      d_feature[i] = vec4(0);
    }
    uint o = 0;
    do {
      float d[N];
      [[unroll]] for (int i = 0; i < N; ++i)
        d[i] = d_turned[(places.y + o * dim + i / N2 * across + i % N2) * p.edges + edge];
      [[unroll]] for (int f = 0; f < N; ++f) d_coefficient[f] = coefficient[f] = vec4(0);
      [[unroll]] for (int to = 0; to < N; ++to)
        [[unroll]] for (int from = 0; from < N; ++from)
          if (couples(N1, to / N2, from / N2) && couples(N2, to % N2, from % N2)) {
            const int f = (N1 == 1 ? 0 : frequency(to / N2, from / N2)) * N2 +
                          (N2 == 1 ? 0 : frequency(to % N2, from % N2));
            d_coefficient[f] +=
                side_sign(to / N2, from / N2) * side_sign(to % N2, from % N2) * d[to] * feature[from];
          }
      shorten_gradient(norm, differs1, differs2);
      add_columns(0, c * channels + o, step);
      if (PER_PART == 2) add_columns(PER_PART - 1, c * channels + o, step);
      if (inside) {
        [[unroll]] for (int f = 0; f < N; ++f)
          d_coefficients[(more.x + f * step + c * channels + o) * p.edges + edge] = d_coefficient[f];
      }
      shorten(norm, differs1, differs2);
      [[unroll]] for (int to = 0; to < N; ++to)
        [[unroll]] for (int from = 0; from < N; ++from)
          if (couples(N1, to / N2, from / N2) && couples(N2, to % N2, from % N2)) {
            const int f = (N1 == 1 ? 0 : frequency(to / N2, from / N2)) * N2 +
                          (N2 == 1 ? 0 : frequency(to % N2, from % N2));
            d_feature[from] +=
                side_sign(to / N2, from / N2) * side_sign(to % N2, from % N2) * d[to] * coefficient[f];
          }
    } while (++o < channels);
    if (inside) {
      [[unroll]] for (int i = 0; i < N; ++i) d_features[(more.y + c * N + i) * p.edges + edge] = d_feature[i];
    }
  }
  [[unroll]] for (int t = 0; t < PER_PART; ++t) {
    const vec4 d = radial_gradient(more.z + t, products[t], lengths, x[t], at[t]);
    if (inside) d_radial[(more.z + t) * p.edges + edge] = d;
  }
}
