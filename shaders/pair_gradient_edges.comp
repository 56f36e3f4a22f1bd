// pair_gradient_edges.comp: what an edge sends to its neighbour's feature and to the positions of its ends, out of its
// frames, an invocation per edge. The angle about an edge's direction cancels, so that turning the direction by ω changes
// its messages by [ω]·message − kernel([ω]·feature): the direction's gradient is a torque.
// in  0 order      u32[N·K,2]      of the run's edges: edge, neighbour
// in  1 positions  f32[B·KEYS,8]   xyz of the source, xyz of the reference, 0 0
// in  2 messages   f32[N·K,M]
// in  3 d_messages f32[N·K,M]
// in  4 turned     f32[16·IN4,N·K,4] features in the frames: common/pair_record.glsl; in the order of 0, as the next two
// in  5 d_features f32[W,N·K,4]    their gradients, part by part
// in  6 d_radial   f32[TABLES,N·K,4] gradients of the lengths
// con 7 firsts     u32[8,4]        where a part begins in d_features[], by degree out and in; values, then keys
// out 8 edges      f32[N·K,F+8]    gradients of the feature and of centre − neighbour, both sides
// spec 0 WORKGROUP=32  1 K≤64  2 THIRD  3–6 IN  7–10 VALUES  11–14 KEYS  15 LINEAR  16 SEARCH
// grid ceil(N·K / WORKGROUP) | shared 0 KiB
// loops ≤ IN4 + TABLES + VALUES + KEYS < 65535 | error: see src/ops/gradient.hpp | fp32
#version 450
#extension GL_EXT_control_flow_attributes : require
#extension GL_GOOGLE_include_directive : require
#include "common/pair_layer.glsl"
#include "common/parameters.glsl"
#include "common/pair_record.glsl"
#include "common/texels.glsl"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const uint K = 24;
layout(constant_id = 2) const uint THIRD = 0;
layout(set = 0, binding = 0) readonly buffer Order { uvec2 order[]; };
READ_VEC4S(1, Positions);
layout(set = 0, binding = 2) readonly buffer Messages { float messages[]; };
layout(set = 0, binding = 3) readonly buffer DMessages { float d_messages[]; };
READ_VEC4S(4, Turned);
READ_VEC4S(5, D_features);
READ_VEC4S(6, D_radial);
layout(set = 0, binding = 7) uniform Firsts { uvec4 firsts[8]; };
layout(set = 0, binding = 8) writeonly buffer Edges { float edges[]; };
layout(push_constant) uniform Push { PairGradientParameters p; };
#define features messages  // vectors are read from these
#define POSITION(at) VEC4_OF(Positions, at)
#include "common/pair_edge.glsl"

const int EDGE = FEATURE_STRIDE + 8;

vec4 part_sum(uint slot, int a, int b, int c) {
  const int q = b > 0 ? 1 : 0, from = 2 * (a > 0 ? 1 : 0) + q;
  const int i = max(a - 1, 0), j = max(b - 1, 0);
  vec4 sum = vec4(0);
  [[unroll]] for (int set = 0; set < (LINEAR ? 2 : 1); ++set)
    [[unroll]] for (int to = 0; to < 4; ++to) {
      const int n1 = from / 2 + to / 2 == 2 ? 3 : 1, n2 = from % 2 + to % 2 == 2 ? 3 : 1;
      if (i < n1 && j < n2)
        sum += VEC4_OF(D_features, (firsts[4 * set + to][from] + c * n1 * n2 + i * n2 + j) * p.edges + slot);
    }
  return sum;
}

// Σ over four channels of x × y, which have their components at `at` and `step` further on.
vec3 cross_sum(vec4 x[16], vec4 y[16], int at, int step) {
  const vec4 x0 = x[at], x1 = x[at + step], x2 = x[at + 2 * step];
  const vec4 y0 = y[at], y1 = y[at + step], y2 = y[at + 2 * step];
  return vec3(dot(x1, y2) - dot(x2, y1), dot(x2, y0) - dot(x0, y2), dot(x0, y1) - dot(x1, y0));
}

vec3 message_torque(uint at, uint step) {
  return cross(vec3(messages[at], messages[at + step], messages[at + 2u * step]),
               vec3(d_messages[at], d_messages[at + step], d_messages[at + 2u * step]));
}

// The gradient with respect to a side's vector, from its torque and its length's gradient.
vec3 move(Side side, vec3 torque, vec3 turned_torque, float d_norm) {
  const vec3 t = turn_into(torque, side.axes[0], side.axes[1], side.axes[2]) - turned_torque;
  const bool positive = side.norm > 0.0;
  const float scale = positive ? 1.0 / side.norm : 0.0;
  const vec3 d = vec3(positive ? d_norm : 0.0, t.z * scale, -t.y * scale);
  return turn_back(d, side.axes[0], side.axes[1], side.axes[2]).zxy;
}

void main() {
  const bool inside = gl_GlobalInvocationID.x < p.edges;
  const uint slot = min(gl_GlobalInvocationID.x, p.edges - 1u), edge = order[slot].x;
  const PairEdge sides = pair_edge(p.first_node + edge / K, order[slot].y);
  const vec3 x1 = sides.source.axes[0], y1 = sides.source.axes[1], z1 = sides.source.axes[2];
  const vec3 x2 = sides.reference.axes[0], y2 = sides.reference.axes[1], z2 = sides.reference.axes[2];
  vec3 turned_torque1 = vec3(0), turned_torque2 = vec3(0);
  for (int c = 0; c < IN4; ++c) {
    vec4 f[16], d[16];
    [[unroll]] for (int i = 0; i < 16; ++i) {
      f[i] = VEC4_OF(Turned, (i * IN4 + c) * p.edges + slot);
      d[i] = part_sum(slot, i / 4, i % 4, c);
    }
    [[unroll]] for (int i = 0; i < 4; ++i) {
      turned_torque1 += cross_sum(f, d, 4 + i, 4);
      turned_torque2 += cross_sum(f, d, 4 * i + 1, 1);
    }
    [[unroll]] for (int lane = 0; lane < 4; ++lane) {
      const int channel = 4 * c + lane;
      const uint to = edge * EDGE;
      if (inside && channel < IN0) edges[to + channel] = d[0][lane];
      const vec3 second = turn_back(vec3(d[1][lane], d[2][lane], d[3][lane]), x2, y2, z2);
      const vec3 first = turn_back(vec3(d[4][lane], d[8][lane], d[12][lane]), x1, y1, z1);
      vec3 both[3];
      [[unroll]] for (int a = 0; a < 3; ++a)
        both[a] = turn_back(vec3(d[4 * a + 5][lane], d[4 * a + 6][lane], d[4 * a + 7][lane]), x2, y2, z2);
      [[unroll]] for (int a = 0; a < 3; ++a) {
        if (inside && channel < IN1) edges[to + FEATURE1 + 3 * channel + a] = second[a];
        if (inside && channel < IN2) edges[to + FEATURE2 + 3 * channel + a] = first[a];
        const vec3 row = x1[a] * both[0] + y1[a] * both[1] + z1[a] * both[2];
        [[unroll]] for (int b = 0; b < 3; ++b)
          if (inside && channel < IN3) edges[to + FEATURE3 + 9 * channel + 3 * a + b] = row[b];
      }
    }
  }

  vec3 torque1 = vec3(0), torque2 = vec3(0);
  const uint message = edge * MESSAGE_STRIDE;
  for (int o = 0; o < MESSAGES(1); ++o) torque2 += message_torque(message + MESSAGE1 + 3 * o, 1);
  for (int o = 0; o < MESSAGES(2); ++o) torque1 += message_torque(message + MESSAGE2 + 3 * o, 1);
  for (int o = 0; o < MESSAGES(3); ++o)
    [[unroll]] for (int i = 0; i < 3; ++i) {
      torque1 += message_torque(message + MESSAGE3 + 9 * o + i, 3);
      torque2 += message_torque(message + MESSAGE3 + 9 * o + 3 * i, 1);
    }
  vec2 d_norms = vec2(0);
  for (int t = 0; t < TABLES; ++t) d_norms += VEC4_OF(D_radial, t * p.edges + slot).xy;
  const vec3 d1 = move(sides.source, torque1, turned_torque1, d_norms.x);
  const vec3 d2 = move(sides.reference, torque2, turned_torque2, d_norms.y);
  if (inside) {
    const uint to = edge * EDGE + FEATURE_STRIDE;
    [[unroll]] for (int a = 0; a < 3; ++a) {
      edges[to + a] = d1[a];
      edges[to + 3 + a] = d2[a];
    }
    edges[to + 6] = 0.0;
    edges[to + 7] = 0.0;
    for (int i = FEATURE3 + 9 * IN3; i < FEATURE_STRIDE; ++i) edges[edge * EDGE + i] = 0.0;
  }
}
