// point_attention.comp: one-sided attention whose edges carry no weights, and its projected ReLU, an invocation
// per centre; see src/ops/point_attention.hpp for the algebra and the names of the matrices.
// in  0 features     f32[P,F]      C0 scalars, C1 vectors (y,z,x); padded to F, a multiple of 4
// in  1 index        u32[Q,K]
// in  2 centres      f32[Q,4]      xyz
// in  3 neighbours   f32[P,4]      xyz
// in  4 coefficients f32[clouds,D] matrices of degree 0 (M0 O0 S0 Mz0 Oz0), if they come per cloud
// in  5 tiles        u32[tiles,4]
// out 6 result       f32[Q,R]      OUT0 scalars, OUT1 vectors; padded to R
// con 7 weights      f32[WEIGHTS,4] matrices of degree 1 (M1 O1 S1 Mz1 Oz1 plane), then of degree 0
// out 8 kept         f32[Q,KEPT,4] sums of degree 0 and, by component, 1; flag; per head largest logit, 1 / total: for
//                                the gradient, if it is to follow
// spec 0 WORKGROUP=32  1 K≤64  2 C0  3 C1  4 OUT0  5 OUT1  6 HEADS  7 FLAGS  8 WEIGHTS | grid tiles | shared 0 KiB
// loops ≤ K + OUT0 ≤ 1088 < 65535 | error: see src/ops/point_attention.hpp | fp32
#version 450
#extension GL_EXT_control_flow_attributes : require
#extension GL_GOOGLE_include_directive : require
#ifdef TEXELS
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_shuffle : require
#endif
#include "common/edge.glsl"
#include "common/parameters.glsl"
#include "common/projected_relu.glsl"
#include "common/texels.glsl"

layout(local_size_x_id = 0) in;
#include "common/point_layer.glsl"

const bool KEEP = (FLAGS & POINT_KEEP) != 0u;

// Factors of the Clebsch–Gordan products 1 ⊗ 1 → 1: −1/√3, 1/√2, 1/√6.
const float CG0 = -0.57735026918962576, CG1 = 0.70710678118654752, CG2 = 0.40824829046386302;

READ_VEC4S(0, Features);
layout(set = 0, binding = 1) readonly buffer Index { uint index[]; };
READ_VEC4S(2, Centres);
READ_VEC4S(3, Neighbours);
layout(set = 0, binding = 4) readonly buffer Coefficients { float coefficients[]; };
layout(set = 0, binding = 5) readonly buffer Tiles { uvec4 tiles[]; };
layout(set = 0, binding = 6) writeonly buffer Result { float result[]; };
layout(set = 0, binding = 7) uniform Weights { vec4 weights[WEIGHTS]; };
layout(set = 0, binding = 8) writeonly buffer Kept { vec4 kept[]; };
layout(push_constant) uniform Push { PointParameters p; };

const int KEPT_SUM1 = QUADS(HEADS * N0), KEPT_STATE = KEPT_SUM1 + 3 * QUADS(HEADS * N1), KEPT = KEPT_STATE + 1 + HEADS;

#include "common/point_weights.glsl"

#define SCALAR(f, c) f[c]
#define VECTOR(f, c) vec3(f[C0 + 3 * (c)], f[C0 + 3 * (c) + 1], f[C0 + 3 * (c) + 2])
// Entries of the sums; beyond their end there are zeros.
#define KEPT0(i) ((i) < HEADS * N0 ? sum0[(i) < HEADS * N0 ? (i) : 0] : 0.0)
#define KEPT1(i, a) ((i) < HEADS * N1 ? sum1[(i) < HEADS * N1 ? (i) : 0][a] : 0.0)
// The row of a point into f[4 * F4].
#define LOAD_FEATURE(f, row)                       \
  [[unroll]] for (int i = 0; i < F4; ++i) {        \
    const vec4 part = VEC4_OF(Features, (row) * F4 + i);    \
    f[4 * i] = part.x, f[4 * i + 1] = part.y;      \
    f[4 * i + 2] = part.z, f[4 * i + 3] = part.w;  \
  }

void main() {
  const uvec4 tile = tiles[p.first_tile + gl_WorkGroupID.x];
  const uint row = min(tile.y + gl_LocalInvocationID.x, tile.z - 1);
  cloud = tile.x;

  float query0[HEADS * N0], zero_query0[HEADS * Z0];
  vec3 query1[HEADS * N1 > 0 ? HEADS * N1 : 1];
  float own[4 * F4];
  if (!UNIFORM) {
    LOAD_FEATURE(own, row)
    WEIGHTS0(m0, M0, HEADS * N0 * Z0)
    [[unroll]] for (int i = 0; i < HEADS * N0; ++i) {
      query0[i] = m0[i * Z0 + C0];
      [[unroll]] for (int c = 0; c < C0; ++c) query0[i] += m0[i * Z0 + c] * SCALAR(own, c);
    }
    WEIGHTS0(mz0, MZ0, HEADS * Z0 * Z0)
    [[unroll]] for (int i = 0; i < HEADS * Z0; ++i) {
      zero_query0[i] = mz0[i * Z0 + C0];
      [[unroll]] for (int c = 0; c < C0; ++c) zero_query0[i] += mz0[i * Z0 + c] * SCALAR(own, c);
    }
    [[unroll]] for (int i = 0; i < KEYS1 * HEADS * N1; ++i) {
      query1[i] = vec3(0);
      [[unroll]] for (int c = 0; c < C1; ++c) query1[i] += weight1(M1 + i * C1 + c) * VECTOR(own, c);
    }
  }

  // Softmax in one pass over the edges: relative to the largest logit so far.
  float largest[HEADS], total[HEADS];
  float sum0[HEADS * N0], zero_sum0[HEADS * Z0];
  vec3 sum1[HEADS * N1 > 0 ? HEADS * N1 : 1], zero_sum1[HEADS * Z1 > 0 ? HEADS * Z1 : 1];
  [[unroll]] for (int h = 0; h < HEADS; ++h) {
    largest[h] = UNIFORM ? 0.0 : uintBitsToFloat(0xff800000u);
    total[h] = 0.0;
  }
  [[unroll]] for (int i = 0; i < HEADS * N0; ++i) sum0[i] = 0.0;
  [[unroll]] for (int i = 0; i < HEADS * N1; ++i) sum1[i] = vec3(0);
  [[unroll]] for (int i = 0; i < HEADS * Z0; ++i) zero_sum0[i] = 0.0;
  [[unroll]] for (int i = 0; i < HEADS * Z1; ++i) zero_sum1[i] = vec3(0);
  bool duplicates = false;

  const vec3 centre = VEC4_OF(Centres, row).xyz;
  const uint first_edge = (row - p.first_row) * K;
  for (int j = 0; j < K; ++j) {
    const uint neighbour = index[first_edge + j];
    const Edge edge = edge_between(centre, VEC4_OF(Neighbours, neighbour).xyz);
    const vec3 v = edge.direction;
    float f[4 * F4];
    LOAD_FEATURE(f, neighbour)
    const float positive = edge.zero ? 0.0 : 1.0;
    duplicates = duplicates || edge.zero;

    // φ, zero for edges of length zero.
    float phi0[N0];
    vec3 phi1[N1 > 0 ? N1 : 1];
    [[unroll]] for (int c = 0; c < C0; ++c) phi0[c] = positive * SCALAR(f, c);
    [[unroll]] for (int c = 0; c < C1; ++c) phi0[C0 + c] = dot(v, VECTOR(f, c));
    if (DIRECTION) {
      phi0[N0 - 3] = v.x;
      phi0[N0 - 2] = v.y;
      phi0[N0 - 1] = v.z;
    }
    if (N1 > 0) {
      [[unroll]] for (int c = 0; c < C0; ++c) phi1[c] = v * SCALAR(f, c);
      [[unroll]] for (int c = 0; c < C1; ++c) {
        phi1[C0 + c] = CG0 * positive * VECTOR(f, c);
        phi1[C0 + C1 + c] = CG1 * cross(v, VECTOR(f, c));
        phi1[C0 + 2 * C1 + c] = CG2 * (3.0 * phi0[C0 + c] * v - edge.square * VECTOR(f, c));
      }
    }

    [[unroll]] for (int h = 0; h < HEADS; ++h) {
      float scale = 1.0, weight = 1.0;
      if (!UNIFORM) {
        float logit = 0.0;
        [[unroll]] for (int i = 0; i < N0; ++i) logit += query0[h * N0 + i] * phi0[i];
        [[unroll]] for (int i = 0; i < KEYS1 * N1; ++i) logit += dot(query1[h * N1 + i], phi1[i]);
        if (edge.zero) {
          [[unroll]] for (int i = 0; i < Z0; ++i)
            logit += zero_query0[h * Z0 + i] * (i < C0 ? SCALAR(f, i < C0 ? i : 0) : 1.0);
          [[unroll]] for (int i = 0; i < KEYS1 * Z1; ++i) {
            vec3 q = vec3(0);
            [[unroll]] for (int c = 0; c < C1; ++c) q += weight1(MZ1 + (h * Z1 + i) * C1 + c) * VECTOR(own, c);
            logit += dot(q, VECTOR(f, i));
          }
        }
        const float above = logit - largest[h];
        const float less = exp(-abs(above));
        scale = above > 0.0 ? less : 1.0;
        weight = above > 0.0 ? 1.0 : less;
        largest[h] = max(largest[h], logit);
      }
      total[h] = total[h] * scale + weight;
      [[unroll]] for (int i = 0; i < N0; ++i) sum0[h * N0 + i] = sum0[h * N0 + i] * scale + weight * phi0[i];
      [[unroll]] for (int i = 0; i < N1; ++i) sum1[h * N1 + i] = sum1[h * N1 + i] * scale + weight * phi1[i];
      if (duplicates) {
        const float zero_weight = edge.zero ? weight : 0.0;
        [[unroll]] for (int i = 0; i < Z0; ++i)
          zero_sum0[h * Z0 + i] = zero_sum0[h * Z0 + i] * scale +
                                  zero_weight * (i < C0 ? SCALAR(f, i < C0 ? i : 0) : 1.0);
        [[unroll]] for (int i = 0; i < Z1; ++i)
          zero_sum1[h * Z1 + i] = zero_sum1[h * Z1 + i] * scale + zero_weight * VECTOR(f, i);
      }
    }
  }

  [[unroll]] for (int h = 0; h < HEADS; ++h) {
    const float share = 1.0 / total[h];
    [[unroll]] for (int i = 0; i < N0; ++i) sum0[h * N0 + i] *= share;
    [[unroll]] for (int i = 0; i < N1; ++i) sum1[h * N1 + i] *= share;
    [[unroll]] for (int i = 0; i < Z0; ++i) zero_sum0[h * Z0 + i] *= share;
    [[unroll]] for (int i = 0; i < Z1; ++i) zero_sum1[h * Z1 + i] *= share;
  }

  const bool inside = tile.y + gl_LocalInvocationID.x < tile.z;
  if (KEEP && inside) {
    const uint at = row * KEPT;
    [[unroll]] for (int i = 0; i < QUADS(HEADS * N0); ++i)
      kept[at + i] = vec4(KEPT0(4 * i), KEPT0(4 * i + 1), KEPT0(4 * i + 2), KEPT0(4 * i + 3));
    [[unroll]] for (int a = 0; a < 3; ++a)
      [[unroll]] for (int i = 0; i < QUADS(HEADS * N1); ++i)
        kept[at + KEPT_SUM1 + a * QUADS(HEADS * N1) + i] =
            vec4(KEPT1(4 * i, a), KEPT1(4 * i + 1, a), KEPT1(4 * i + 2, a), KEPT1(4 * i + 3, a));
    kept[at + KEPT_STATE] = vec4(uintBitsToFloat(duplicates ? 1u : 0u), 0, 0, 0);
    [[unroll]] for (int h = 0; h < HEADS; ++h)
      kept[at + KEPT_STATE + 1 + h] = vec4(largest[h], 1.0 / total[h], 0, 0);
  }
  // Many outputs of degree 0 (a logit per key point): one after the other, or the code grows with their number.
  if (OUT1 == 0 && !RELU) {
    for (int o = 0; o < OUT0; ++o) {
      float x = 0.0;
      if (!UNIFORM) {
        WEIGHTS0(s0, S0 + o * Z0, Z0)
        x = s0[C0];
        [[unroll]] for (int c = 0; c < C0; ++c) x += s0[c] * SCALAR(own, c);
      }
      WEIGHTS0(o0, O0 + o * HEADS * N0, HEADS * N0)
      [[unroll]] for (int i = 0; i < HEADS * N0; ++i) x += o0[i] * sum0[i];
      if (duplicates) {
        [[unroll]] for (int i = 0; i < HEADS * Z0; ++i) x += weight0(OZ0 + o * HEADS * Z0 + i) * zero_sum0[i];
      }
      if (inside) result[(row - p.first_row) * R4 * 4 + o] = x;
    }
    return;
  }

  float scalars[OUT0 > 0 ? OUT0 : 1];
  vec3 vectors[OUT1 > 0 ? OUT1 : 1];
  [[unroll]] for (int o = 0; o < OUT0; ++o) {
    float x = 0.0;
    if (!UNIFORM) {
      x = weight0(S0 + o * Z0 + C0);
      [[unroll]] for (int c = 0; c < C0; ++c) x += weight0(S0 + o * Z0 + c) * SCALAR(own, c);
    }
    [[unroll]] for (int i = 0; i < HEADS * N0; ++i) x += weight0(O0 + o * HEADS * N0 + i) * sum0[i];
    scalars[o] = x;
  }
  [[unroll]] for (int o = 0; o < OUT1; ++o) {
    vec3 x = vec3(0);
    if (!UNIFORM) {
      [[unroll]] for (int c = 0; c < C1; ++c) x += weight1(S1 + o * C1 + c) * VECTOR(own, c);
    }
    [[unroll]] for (int i = 0; i < HEADS * N1; ++i) x += weight1(O1 + o * HEADS * N1 + i) * sum1[i];
    vectors[o] = x;
  }
  if (duplicates) {
    [[unroll]] for (int o = 0; o < OUT0; ++o)
      [[unroll]] for (int i = 0; i < HEADS * Z0; ++i)
        scalars[o] += weight0(OZ0 + o * HEADS * Z0 + i) * zero_sum0[i];
    [[unroll]] for (int o = 0; o < OUT1; ++o)
      [[unroll]] for (int i = 0; i < HEADS * Z1; ++i)
        vectors[o] += weight1(OZ1 + o * HEADS * Z1 + i) * zero_sum1[i];
  }

  float row_out[4 * R4];
  [[unroll]] for (int o = 0; o < OUT0; ++o) row_out[o] = RELU ? leaky(scalars[o]) : scalars[o];
  [[unroll]] for (int o = 0; o < OUT1; ++o) {
    vec3 x = vectors[o];
    if (RELU) {
      vec3 mixed = vec3(0);
      [[unroll]] for (int c = 0; c < OUT1; ++c) mixed += weight1(PLANE + o * OUT1 + c) * vectors[c];
      x = projected_relu(x, mixed, RELU_SQUARE);
    }
    row_out[OUT0 + 3 * o] = x.x, row_out[OUT0 + 3 * o + 1] = x.y, row_out[OUT0 + 3 * o + 2] = x.z;
  }
  [[unroll]] for (int i = OUT0 + 3 * OUT1; i < 4 * R4; ++i) row_out[i] = 0.0;
  if (inside) {
    [[unroll]] for (int i = 0; i < 4 * R4; ++i) result[(row - p.first_row) * R4 * 4 + i] = row_out[i];
  }
}
