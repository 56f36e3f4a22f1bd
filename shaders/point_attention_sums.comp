// point_attention_sums.comp: first half of the gradient of one-sided attention, an invocation per centre: what the
// layer sums over a row's edges, and the gradient before its projected ReLU; see src/ops/point_attention.hpp. Rows with
// edges of length zero are flagged, and their tiles done again by a variant that knows such edges.
// in  0 features     f32[P,F]      C0 scalars, C1 vectors (y,z,x); padded to F, a multiple of 4
// in  1 index        u32[Q,K]      from first_row on
// in  2 centres      f32[Q,4]      xyz
// in  3 neighbours   f32[P,4]      xyz; or what point_attention.comp kept, with KEPT
// in  4 coefficients f32[clouds,D] matrices of degree 0 (M0 O0 S0 Mz0 Oz0), if they come per cloud
// in  5 tiles        u32[tiles,4]
// in  6 given        f32[Q,R]      gradient of the result: OUT0 scalars, OUT1 vectors; padded to R
// mod 7 record       f32[Q,RECORD] common/point_record.glsl; from first_row on
// con 8 weights      f32[WEIGHTS,4] matrices of degree 1 (M1 O1 S1 Mz1 Oz1 plane), then of degree 0
// spec 0 WORKGROUP=32  1 K≤64  2 C0  3 C1  4 OUT0  5 OUT1  6 HEADS  7 FLAGS  8 WEIGHTS
// grid tiles, or tiles / 32 | shared 0.5 KiB
// loops ≤ 32·(K + 2·OUT0 + 4) ≤ 36992 < 65535 | error: see src/ops/gradient.hpp | fp32
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
READ_VEC4S(0, Features);
layout(set = 0, binding = 1) readonly buffer Index { uint index[]; };
READ_VEC4S(2, Centres);
READ_VEC4S(3, Neighbours);
layout(set = 0, binding = 4) readonly buffer Coefficients { float coefficients[]; };
layout(set = 0, binding = 5) readonly buffer Tiles { uvec4 tiles[]; };
READ_VEC4S(6, Given);
layout(set = 0, binding = 7) buffer Record { vec4 record[]; };
#include "common/point_layer.glsl"
#include "common/point_record.glsl"
layout(set = 0, binding = 8) uniform Weights { vec4 weights[WEIGHTS]; };
layout(push_constant) uniform Push { PointGradientParameters p; };
#include "common/point_weights.glsl"
#include "common/point_paths.glsl"
#include "common/projected_relu_gradient.glsl"

float largest[HEADS], total[HEADS], delta[HEADS];
float sum0[HEADS * N0], zero_sum0[HEADS * Z0];
vec3 sum1[HEADS * AT_LEAST_N1], zero_sum1[HEADS * AT_LEAST_Z1];
float given0[OUT0 > 0 && OUT1 > 0 ? OUT0 : 1];
vec3 given1[AT_LEAST_OUT1];
vec3 linear[AT_LEAST_OUT1], mixed[AT_LEAST_OUT1];

void sum_edges(uint row, uint first_edge, uint at, bool inside) {
  [[unroll]] for (int h = 0; h < HEADS; ++h) {
    largest[h] = UNIFORM ? 0.0 : uintBitsToFloat(0xff800000u);
    total[h] = 0.0;
  }
  [[unroll]] for (int i = 0; i < HEADS * N0; ++i) sum0[i] = 0.0;
  [[unroll]] for (int i = 0; i < HEADS * N1; ++i) sum1[i] = vec3(0);
  [[unroll]] for (int i = 0; i < HEADS * Z0; ++i) zero_sum0[i] = 0.0;
  [[unroll]] for (int i = 0; i < HEADS * Z1; ++i) zero_sum1[i] = vec3(0);
  const vec3 centre = VEC4_OF(Centres, row).xyz;
  uint zero = 0u;
  // Softmax in one pass over the edges: relative to the largest logit so far.
  for (int j = 0; j < K; ++j) {
    const uint neighbour = index[first_edge + j];
    const Edge edge = edge_between(centre, VEC4_OF(Neighbours, neighbour).xyz);
    zero |= edge.zero ? 1u : 0u;
    make_paths(edge, neighbour);
    [[unroll]] for (int h = 0; h < HEADS; ++h) {
      float scale = 1.0, weight = 1.0;
      if (!UNIFORM) {
        const float e = logit(h), above = e - largest[h], less = exp(-abs(above));
        scale = above > 0.0 ? less : 1.0;
        weight = above > 0.0 ? 1.0 : less;
        largest[h] = max(largest[h], e);
      }
      total[h] = total[h] * scale + weight;
      [[unroll]] for (int i = 0; i < N0; ++i) sum0[h * N0 + i] = sum0[h * N0 + i] * scale + weight * phi0[i];
      [[unroll]] for (int i = 0; i < N1; ++i) sum1[h * N1 + i] = sum1[h * N1 + i] * scale + weight * phi1[i];
      if (ZERO) {
        [[unroll]] for (int i = 0; i < Z0; ++i)
          zero_sum0[h * Z0 + i] = zero_sum0[h * Z0 + i] * scale + weight * zero_phi0[i];
        [[unroll]] for (int i = 0; i < Z1; ++i)
          zero_sum1[h * Z1 + i] = zero_sum1[h * Z1 + i] * scale + weight * zero_phi1[i];
      }
    }
  }
  [[unroll]] for (int h = 0; h < HEADS; ++h) {
    total[h] = 1.0 / total[h];
    [[unroll]] for (int i = 0; i < N0; ++i) sum0[h * N0 + i] *= total[h];
    [[unroll]] for (int i = 0; i < N1; ++i) sum1[h * N1 + i] *= total[h];
    [[unroll]] for (int i = 0; i < Z0; ++i) zero_sum0[h * Z0 + i] *= total[h];
    [[unroll]] for (int i = 0; i < Z1; ++i) zero_sum1[h * Z1 + i] *= total[h];
  }
  if (inside) record[at + STATE] = vec4(uintBitsToFloat(zero), 0, 0, 0);
}

// What sum_edges() makes, from what the layer kept.
void load_sums(uint row, uint at, bool inside) {
  const int state = QUADS(HEADS * N0) + 3 * QUADS(HEADS * N1);
  const uint from = row * (state + 1 + HEADS);
  [[unroll]] for (int i = 0; i < HEADS * N0; ++i) sum0[i] = VEC4_OF(Neighbours, from + i / 4)[i % 4];
  [[unroll]] for (int a = 0; a < 3; ++a)
    [[unroll]] for (int i = 0; i < HEADS * N1; ++i)
      sum1[i][a] = VEC4_OF(Neighbours, from + QUADS(HEADS * N0) + a * QUADS(HEADS * N1) + i / 4)[i % 4];
  [[unroll]] for (int h = 0; h < HEADS; ++h) {
    const vec4 kept = VEC4_OF(Neighbours, from + state + 1 + h);
    largest[h] = kept.x;
    total[h] = kept.y;
  }
  if (inside) record[at + STATE] = VEC4_OF(Neighbours, from + state);
}

void load_given(uint row) {
  float g[4 * R4];
  [[unroll]] for (int i = 0; i < R4; ++i) {
    const vec4 part = VEC4_OF(Given, row * R4 + i);
    LOAD(g, i, part);
  }
  [[unroll]] for (int o = 0; o < OUT0; ++o) given0[o] = g[o];
  [[unroll]] for (int o = 0; o < OUT1; ++o) given1[o] = vec3(g[OUT0 + 3 * o], g[OUT0 + 3 * o + 1], g[OUT0 + 3 * o + 2]);
}

float linear0(int o) {
  float x = 0.0;
  if (!UNIFORM) {
    x = weight0(S0 + o * Z0 + C0);
    [[unroll]] for (int c = 0; c < C0; ++c) x += weight0(S0 + o * Z0 + c) * SCALAR(own, c);
  }
  [[unroll]] for (int i = 0; i < HEADS * N0; ++i) x += weight0(O0 + o * HEADS * N0 + i) * sum0[i];
  if (ZERO) {
    [[unroll]] for (int i = 0; i < HEADS * Z0; ++i) x += weight0(OZ0 + o * HEADS * Z0 + i) * zero_sum0[i];
  }
  return x;
}

vec3 linear1(int o) {
  vec3 x = vec3(0);
  if (!UNIFORM) {
    [[unroll]] for (int c = 0; c < C1; ++c) x += weight1(S1 + o * C1 + c) * VECTOR(own, c);
  }
  [[unroll]] for (int i = 0; i < HEADS * N1; ++i) x += weight1(O1 + o * HEADS * N1 + i) * sum1[i];
  if (ZERO) {
    [[unroll]] for (int i = 0; i < HEADS * Z1; ++i) x += weight1(OZ1 + o * HEADS * Z1 + i) * zero_sum1[i];
  }
  return x;
}

// given: from after the ReLU to before it.
void differentiate_relu() {
  [[unroll]] for (int o = 0; o < OUT0; ++o)
    if (!(linear0(o) > 0.0)) given0[o] *= LEAKY_SLOPE;
  [[unroll]] for (int o = 0; o < OUT1; ++o) linear[o] = linear1(o);
  [[unroll]] for (int o = 0; o < OUT1; ++o) {
    vec3 normal = vec3(0);
    [[unroll]] for (int c = 0; c < OUT1; ++c) normal += weight1(PLANE + o * OUT1 + c) * linear[c];
    const ReluGradient gradient = projected_relu_gradient(linear[o], normal, given1[o], RELU_SQUARE);
    given1[o] = gradient.x;
    mixed[o] = gradient.mixed;
  }
  [[unroll]] for (int o = 0; o < OUT1; ++o)
    [[unroll]] for (int c = 0; c < OUT1; ++c) given1[c] += weight1(PLANE + o * OUT1 + c) * mixed[o];
}

// delta: per head, the sums times their gradients.
void find_delta() {
  [[unroll]] for (int h = 0; h < HEADS; ++h) {
    delta[h] = 0.0;
    [[unroll]] for (int i = h * N0; i < (h + 1) * N0; ++i)
      [[unroll]] for (int o = 0; o < OUT0; ++o) delta[h] += weight0(O0 + o * HEADS * N0 + i) * given0[o] * sum0[i];
    [[unroll]] for (int i = h * N1; i < (h + 1) * N1; ++i) {
      vec3 x = vec3(0);
      [[unroll]] for (int o = 0; o < OUT1; ++o) x += weight1(O1 + o * HEADS * N1 + i) * given1[o];
      delta[h] += dot(x, sum1[i]);
    }
    if (ZERO) {
      [[unroll]] for (int i = h * Z0; i < (h + 1) * Z0; ++i)
        [[unroll]] for (int o = 0; o < OUT0; ++o)
          delta[h] += weight0(OZ0 + o * HEADS * Z0 + i) * given0[o] * zero_sum0[i];
      [[unroll]] for (int i = h * Z1; i < (h + 1) * Z1; ++i) {
        vec3 x = vec3(0);
        [[unroll]] for (int o = 0; o < OUT1; ++o) x += weight1(OZ1 + o * HEADS * Z1 + i) * given1[o];
        delta[h] += dot(x, zero_sum1[i]);
      }
    }
  }
}

// The same of a layer with scalars only, of which there are many: one after the other.
void differentiate_scalars(uint row, uint at, bool inside) {
  float gradient[HEADS * N0], zero_gradient[HEADS * Z0];
  [[unroll]] for (int i = 0; i < HEADS * N0; ++i) gradient[i] = 0.0;
  [[unroll]] for (int i = 0; i < HEADS * Z0; ++i) zero_gradient[i] = 0.0;
  for (int part = 0; part < R4; ++part) {
    vec4 g = VEC4_OF(Given, row * R4 + part);
    for (int o = 4 * part; o < min(4 * part + 4, OUT0); ++o) {
      float x = g[o % 4];
      if (RELU && !(linear0(o) > 0.0)) x *= LEAKY_SLOPE;
      g[o % 4] = x;
      WEIGHTS0(o0, O0 + o * HEADS * N0, HEADS * N0)
      [[unroll]] for (int i = 0; i < HEADS * N0; ++i) gradient[i] += o0[i] * x;
      if (ZERO) {
        WEIGHTS0(oz0, OZ0 + o * HEADS * Z0, HEADS * Z0)
        [[unroll]] for (int i = 0; i < HEADS * Z0; ++i) zero_gradient[i] += oz0[i] * x;
      }
    }
    if (inside) record[at + GIVEN0 + part] = g;
  }
  [[unroll]] for (int h = 0; h < HEADS; ++h) {
    delta[h] = 0.0;
    [[unroll]] for (int i = h * N0; i < (h + 1) * N0; ++i) delta[h] += gradient[i] * sum0[i];
    if (ZERO) {
      [[unroll]] for (int i = h * Z0; i < (h + 1) * Z0; ++i) delta[h] += zero_gradient[i] * zero_sum0[i];
    }
  }
  if (inside) {
    STORE(at + SUM_GRADIENT0, gradient, HEADS * N0);
    if (ZERO) { STORE(at + ZERO_SUM_GRADIENT0, zero_gradient, HEADS * Z0); }
  }
}

void keep(uint at) {
  if (OUT1 > 0) { STORE(at + GIVEN0, given0, OUT0); }
  STORE_VECTORS(at + GIVEN1, given1, OUT1);
  if (RELU) {
    STORE_VECTORS(at + MIXED, mixed, OUT1);
    STORE_VECTORS(at + LINEAR, linear, OUT1);
  }
  if (!UNIFORM) {
    float own0[Z0];
    vec3 own1[C1 > 0 ? C1 : 1];
    [[unroll]] for (int c = 0; c < C0; ++c) own0[c] = SCALAR(own, c);
    own0[C0] = 1.0;
    [[unroll]] for (int c = 0; c < C1; ++c) own1[c] = VECTOR(own, c);
    STORE(at + OWN0, own0, Z0);
    STORE_VECTORS(at + OWN1, own1, C1);
  }
  STORE(at + SUM0, sum0, HEADS * N0);
  STORE_VECTORS(at + SUM1, sum1, HEADS * N1);
  if (ZERO) {
    STORE(at + ZERO_SUM0, zero_sum0, HEADS * Z0);
    STORE_VECTORS(at + ZERO_SUM1, zero_sum1, HEADS * Z1);
  }
  [[unroll]] for (int h = 0; h < HEADS; ++h) record[at + STATE + 1 + h] = vec4(largest[h], total[h], delta[h], 0);
}

void sum_row(uvec4 tile) {
  const uint row = min(tile.y + gl_LocalInvocationID.x, tile.z - 1);
  const bool inside = tile.y + gl_LocalInvocationID.x < tile.z;
  const uint at = (row - p.first_row) * RECORD;
  cloud = tile.x;
  if (!UNIFORM) make_queries(row);
  if (KEPT)
    load_sums(row, at, inside);
  else
    sum_edges(row, (row - p.first_row) * K, at, inside);
  if (OUT1 > 0) {
    load_given(row);
    if (RELU) differentiate_relu();
    find_delta();
  } else {
    differentiate_scalars(row, at, inside);
  }
  if (inside) keep(at);
}

void main() {
  if (ZERO) {
    const uint count = list_flagged();
    for (uint i = 0; i < count; ++i) sum_row(tiles[list[i]]);
  } else {
    sum_row(tiles[p.first_tile + gl_WorkGroupID.x]);
  }
}
