// point_attention_gradient.comp: second half of the gradient of one-sided attention, an invocation per centre, after
// point_attention_sums.comp: the gradients of its queries, of its own feature and position, and what its edges send
// to their neighbours' features.
// in  0 features     f32[P,F]      C0 scalars, C1 vectors (y,z,x); padded to F, a multiple of 4
// in  1 index        u32[Q,K]      from first_row on
// in  2 centres      f32[Q,4]      xyz
// in  3 neighbours   f32[P,4]      xyz
// in  4 coefficients f32[clouds,D] matrices of degree 0 (M0 O0 S0 Mz0 Oz0), if they come per cloud
// in  5 tiles        u32[tiles,4]
// mod 6 record       f32[Q,RECORD] common/point_record.glsl; from first_row on
// out 7 edges        f32[Q,K,F]    from first_row on, if the features' gradient is wanted
// con 8 weights      f32[WEIGHTS,4] matrices of degree 1 (M1 O1 S1 Mz1 Oz1 plane), then of degree 0
// spec 0 WORKGROUP=32  1 K≤64  2 C0  3 C1  4 OUT0  5 OUT1  6 HEADS  7 FLAGS  8 WEIGHTS
// grid tiles, or tiles / 32 | shared 0.5 KiB
// loops ≤ 32·(K + OUT0 + 4) ≤ 36992 < 65535 | error: see src/ops/gradient.hpp | fp32
#version 450
#extension GL_EXT_control_flow_attributes : require
#extension GL_GOOGLE_include_directive : require
#ifdef TEXELS
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_shuffle : require
#endif
#include "common/edge.glsl"
#include "common/parameters.glsl"
#include "common/texels.glsl"

layout(local_size_x_id = 0) in;
READ_VEC4S(0, Features);
layout(set = 0, binding = 1) readonly buffer Index { uint index[]; };
READ_VEC4S(2, Centres);
READ_VEC4S(3, Neighbours);
layout(set = 0, binding = 4) readonly buffer Coefficients { float coefficients[]; };
layout(set = 0, binding = 5) readonly buffer Tiles { uvec4 tiles[]; };
layout(set = 0, binding = 6) buffer Record { vec4 record[]; };
layout(set = 0, binding = 7) writeonly buffer Edges { vec4 edges[]; };
#include "common/point_layer.glsl"
#include "common/point_record.glsl"
layout(set = 0, binding = 8) uniform Weights { vec4 weights[WEIGHTS]; };
layout(push_constant) uniform Push { PointGradientParameters p; };
#include "common/point_weights.glsl"
#include "common/point_paths.glsl"

float largest[HEADS], share[HEADS], delta[HEADS];
float given0[OUT0 > 0 && OUT1 > 0 ? OUT0 : 1];
vec3 given1[AT_LEAST_OUT1];
// Gradients of the sums, of the queries, and of an edge's paths and its direction.
float d_sum0[HEADS * N0], d_zero_sum0[HEADS * Z0];
vec3 d_sum1[HEADS * AT_LEAST_N1], d_zero_sum1[HEADS * AT_LEAST_Z1];
float d_query0[HEADS * N0], d_zero_query0[HEADS * Z0];
vec3 d_query1[HEADS * AT_LEAST_N1], d_zero_query1[HEADS * AT_LEAST_Z1];
float d_phi0[N0], d_zero_phi0[Z0];
vec3 d_phi1[AT_LEAST_N1], d_zero_phi1[AT_LEAST_Z1];
float d_scalar[C0];
vec3 d_vector[C1 > 0 ? C1 : 1];

void load_record(uint at) {
  [[unroll]] for (int h = 0; h < HEADS; ++h) {
    const vec4 state = record[at + STATE + 1 + h];
    largest[h] = state.x;
    share[h] = state.y;
    delta[h] = state.z;
  }
  if (OUT1 == 0) {
    [[unroll]] for (int i = 0; i < HEADS * N0; ++i) d_sum0[i] = record[at + SUM_GRADIENT0 + i / 4][i % 4];
    if (ZERO) {
      [[unroll]] for (int i = 0; i < HEADS * Z0; ++i) d_zero_sum0[i] = record[at + ZERO_SUM_GRADIENT0 + i / 4][i % 4];
    }
    return;
  }
  [[unroll]] for (int o = 0; o < OUT0; ++o) given0[o] = record[at + GIVEN0 + o / 4][o % 4];
  [[unroll]] for (int o = 0; o < OUT1; ++o)
    [[unroll]] for (int a = 0; a < 3; ++a) given1[o][a] = record[at + GIVEN1 + a * QUADS(OUT1) + o / 4][o % 4];
  [[unroll]] for (int i = 0; i < HEADS * N0; ++i) {
    d_sum0[i] = 0.0;
    [[unroll]] for (int o = 0; o < OUT0; ++o) d_sum0[i] += weight0(O0 + o * HEADS * N0 + i) * given0[o];
  }
  [[unroll]] for (int i = 0; i < HEADS * N1; ++i) {
    d_sum1[i] = vec3(0);
    [[unroll]] for (int o = 0; o < OUT1; ++o) d_sum1[i] += weight1(O1 + o * HEADS * N1 + i) * given1[o];
  }
  if (ZERO) {
    [[unroll]] for (int i = 0; i < HEADS * Z0; ++i) {
      d_zero_sum0[i] = 0.0;
      [[unroll]] for (int o = 0; o < OUT0; ++o) d_zero_sum0[i] += weight0(OZ0 + o * HEADS * Z0 + i) * given0[o];
    }
    [[unroll]] for (int i = 0; i < HEADS * Z1; ++i) {
      d_zero_sum1[i] = vec3(0);
      [[unroll]] for (int o = 0; o < OUT1; ++o) d_zero_sum1[i] += weight1(OZ1 + o * HEADS * Z1 + i) * given1[o];
    }
  }
}

// The gradient with respect to an edge's paths and, on the way, to the queries.
void differentiate_attention() {
  [[unroll]] for (int i = 0; i < N0; ++i) d_phi0[i] = 0.0;
  [[unroll]] for (int i = 0; i < N1; ++i) d_phi1[i] = vec3(0);
  [[unroll]] for (int i = 0; i < Z0; ++i) d_zero_phi0[i] = 0.0;
  [[unroll]] for (int i = 0; i < Z1; ++i) d_zero_phi1[i] = vec3(0);
  [[unroll]] for (int h = 0; h < HEADS; ++h) {
    const float weight = UNIFORM ? 1.0 / float(K) : exp(logit(h) - largest[h]) * share[h];
    float d_weight = 0.0;
    [[unroll]] for (int i = 0; i < N0; ++i) d_weight += d_sum0[h * N0 + i] * phi0[i];
    [[unroll]] for (int i = 0; i < N1; ++i) d_weight += dot(d_sum1[h * N1 + i], phi1[i]);
    if (ZERO) {
      [[unroll]] for (int i = 0; i < Z0; ++i) d_weight += d_zero_sum0[h * Z0 + i] * zero_phi0[i];
      [[unroll]] for (int i = 0; i < Z1; ++i) d_weight += dot(d_zero_sum1[h * Z1 + i], zero_phi1[i]);
    }
    const float d_logit = UNIFORM ? 0.0 : weight * (d_weight - delta[h]);
    [[unroll]] for (int i = 0; i < N0; ++i) {
      const int at = h * N0 + i;
      d_phi0[i] += weight * d_sum0[at];
      if (!UNIFORM) {
        d_phi0[i] += d_logit * query0[at];
        d_query0[at] += d_logit * phi0[i];
      }
    }
    [[unroll]] for (int i = 0; i < N1; ++i) {
      const int at = h * N1 + i;
      d_phi1[i] += weight * d_sum1[at];
      if (KEYS1 > 0) {
        d_phi1[i] += d_logit * query1[at];
        d_query1[at] += d_logit * phi1[i];
      }
    }
    if (ZERO) {
      [[unroll]] for (int i = 0; i < Z0; ++i) {
        const int at = h * Z0 + i;
        d_zero_phi0[i] += weight * d_zero_sum0[at];
        if (!UNIFORM) {
          d_zero_phi0[i] += d_logit * zero_query0[at];
          d_zero_query0[at] += d_logit * zero_phi0[i];
        }
      }
      [[unroll]] for (int i = 0; i < Z1; ++i) {
        const int at = h * Z1 + i;
        d_zero_phi1[i] += weight * d_zero_sum1[at];
        if (KEYS1 > 0) {
          d_zero_phi1[i] += d_logit * zero_query1[at];
          d_zero_query1[at] += d_logit * zero_phi1[i];
        }
      }
    }
  }
}

// The gradient with respect to the neighbour's feature; returns that with respect to the direction.
vec3 differentiate_paths(Edge edge) {
  const vec3 v = edge.direction;
  vec3 d_direction = vec3(0);
  [[unroll]] for (int c = 0; c < C0; ++c) {
    d_scalar[c] = d_phi0[c];
    if (N1 > 0) {
      d_scalar[c] += dot(d_phi1[c], v);
      d_direction += SCALAR(feature, c) * d_phi1[c];
    }
  }
  [[unroll]] for (int c = 0; c < C1; ++c) {
    const vec3 f = VECTOR(feature, c);
    d_vector[c] = d_phi0[C0 + c] * v;
    d_direction += d_phi0[C0 + c] * f;
    if (N1 > 0) {
      const vec3 turn = CG1 * d_phi1[C0 + C1 + c], rest = CG2 * d_phi1[C0 + 2 * C1 + c];
      d_vector[c] += CG0 * d_phi1[C0 + c] + cross(turn, v) + 3.0 * dot(rest, v) * v - edge.square * rest;
      d_direction += cross(f, turn) + 3.0 * (dot(v, f) * rest + dot(rest, v) * f);
    }
  }
  if (DIRECTION) d_direction += vec3(d_phi0[N0 - 3], d_phi0[N0 - 2], d_phi0[N0 - 1]);
  if (ZERO && edge.zero) {
    [[unroll]] for (int c = 0; c < C0; ++c) d_scalar[c] = d_zero_phi0[c];
    [[unroll]] for (int c = 0; c < C1; ++c) d_vector[c] = Z1 > 0 ? d_zero_phi1[Z1 > 0 ? c : 0] : vec3(0);
  }
  return d_direction;
}

// A row of features from its parts.
#define FEATURE_ENTRY(i)                                                                      \
  ((i) < C0 ? d_scalar[(i) < C0 ? (i) : 0]                                                    \
            : (i) < C0 + 3 * C1 ? d_vector[(i) < C0 + 3 * C1 && (i) >= C0 ? ((i) - C0) / 3 : 0][((i) - C0 + 3) % 3] \
                                : 0.0)
#define FEATURE_PART(i) \
  vec4(FEATURE_ENTRY(4 * (i)), FEATURE_ENTRY(4 * (i) + 1), FEATURE_ENTRY(4 * (i) + 2), FEATURE_ENTRY(4 * (i) + 3))

// The gradient with respect to the row's own feature, through the queries and S.
void differentiate_own() {
  WEIGHTS0(m0, M0, HEADS * N0 * Z0)
  [[unroll]] for (int c = 0; c < C0; ++c) {
    d_scalar[c] = 0.0;
    [[unroll]] for (int i = 0; i < HEADS * N0; ++i) d_scalar[c] += m0[i * Z0 + c] * d_query0[i];
    if (ZERO) {
      [[unroll]] for (int i = 0; i < HEADS * Z0; ++i) d_scalar[c] += weight0(MZ0 + i * Z0 + c) * d_zero_query0[i];
    }
  }
  [[unroll]] for (int c = 0; c < C1; ++c) {
    d_vector[c] = vec3(0);
    [[unroll]] for (int i = 0; i < KEYS1 * HEADS * N1; ++i) d_vector[c] += weight1(M1 + i * C1 + c) * d_query1[i];
    if (ZERO) {
      [[unroll]] for (int i = 0; i < KEYS1 * HEADS * Z1; ++i)
        d_vector[c] += weight1(MZ1 + i * C1 + c) * d_zero_query1[i];
    }
    [[unroll]] for (int o = 0; o < OUT1; ++o) d_vector[c] += weight1(S1 + o * C1 + c) * given1[o];
  }
}

void add_own_scalars(uint at) {
  if (OUT1 > 0) {
    [[unroll]] for (int c = 0; c < C0; ++c)
      [[unroll]] for (int o = 0; o < OUT0; ++o) d_scalar[c] += weight0(S0 + o * Z0 + c) * given0[o];
  } else {
    for (int o = 0; o < OUT0; ++o) {
      const float g = record[at + GIVEN0 + o / 4][o % 4];
      WEIGHTS0(s0, S0 + o * Z0, Z0)
      [[unroll]] for (int c = 0; c < C0; ++c) d_scalar[c] += s0[c] * g;
    }
  }
}

void differentiate_row(uvec4 tile) {
  const uint row = min(tile.y + gl_LocalInvocationID.x, tile.z - 1);
  const bool inside = tile.y + gl_LocalInvocationID.x < tile.z;
  const uint at = (row - p.first_row) * RECORD, first_edge = (row - p.first_row) * K;
  cloud = tile.x;
  if (!UNIFORM) make_queries(row);
  load_record(at);
  [[unroll]] for (int i = 0; i < HEADS * N0; ++i) d_query0[i] = 0.0;
  [[unroll]] for (int i = 0; i < HEADS * N1; ++i) d_query1[i] = vec3(0);
  [[unroll]] for (int i = 0; i < HEADS * Z0; ++i) d_zero_query0[i] = 0.0;
  [[unroll]] for (int i = 0; i < HEADS * Z1; ++i) d_zero_query1[i] = vec3(0);

  const vec3 centre = VEC4_OF(Centres, row).xyz;
  vec3 d_centre = vec3(0);
  for (int j = 0; j < K; ++j) {
    const uint neighbour = index[first_edge + j];
    const vec3 from = VEC4_OF(Neighbours, neighbour).xyz;
    const Edge edge = edge_between(centre, from);
    make_paths(edge, neighbour);
    differentiate_attention();
    const vec3 d_direction = differentiate_paths(edge);
    if (CENTRES) {
      const float norm = max(length(centre - from), DIRECTION_EPS);
      const vec3 across = d_direction - dot(d_direction, edge.direction) * edge.direction;
      if (!edge.zero) d_centre += across.zxy / norm;
    }
    if (FEATURES && inside) {
      [[unroll]] for (int i = 0; i < F4; ++i) edges[(first_edge + j) * F4 + i] = FEATURE_PART(i);
    }
  }

  if (!UNIFORM && inside) {
    STORE(at + QUERY0, d_query0, HEADS * N0);
    if (KEYS1 > 0) { STORE_VECTORS(at + QUERY1, d_query1, HEADS * N1); }
    if (ZERO) {
      STORE(at + ZERO_QUERY0, d_zero_query0, HEADS * Z0);
      if (KEYS1 > 0) { STORE_VECTORS(at + ZERO_QUERY1, d_zero_query1, HEADS * Z1); }
    }
  }
  if (FEATURES && !UNIFORM) {
    differentiate_own();
    add_own_scalars(at);
    if (inside) {
      [[unroll]] for (int i = 0; i < F4; ++i) record[at + OWN + i] = FEATURE_PART(i);
    }
  }
  if (CENTRES && inside) record[at + CENTRE] = vec4(d_centre, 0);
}

void main() {
  if (ZERO) {
    const uint count = list_flagged();
    for (uint i = 0; i < count; ++i) differentiate_row(tiles[list[i]]);
  } else {
    differentiate_row(tiles[p.first_tile + gl_WorkGroupID.x]);
  }
}
