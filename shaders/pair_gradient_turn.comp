// pair_gradient_turn.comp: neighbours' features and the gradients of messages in the edges' own frames, in their order; an
// invocation per edge and four channels of the features, or one of the messages.
// in  0 features   f32[B·KEYS,F]  four degrees of IN0 … IN3 channels, padded to F, a multiple of 4
// in  1 order      u32[N·K,2]     of the run's edges: edge, neighbour
// in  2 positions  f32[B·KEYS,8]  xyz of the source, xyz of the reference, 0 0
// in  3 d_messages f32[N·K,M]     gradient of the messages
// out 4 turned     f32[16·IN4,N·K,4] by component, channels in vec4s, edge: common/pair_record.glsl
// out 5 d_turned   f32[M,N·K]     gradients of the messages in the frames
// spec 0 WORKGROUP=32  1 K≤64  2 THIRD  3–6 IN  7–10 VALUES  11–14 KEYS  15 LINEAR  16 SEARCH
// grid (ceil(N·K / WORKGROUP), IN4 + most channels of messages) | shared 0 KiB
// loops none | error: see src/ops/gradient.hpp | fp32
#version 450
#extension GL_EXT_control_flow_attributes : require
#extension GL_GOOGLE_include_directive : require
#include "common/pair_layer.glsl"
#include "common/parameters.glsl"
#include "common/pair_record.glsl"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const uint K = 24;
layout(constant_id = 2) const uint THIRD = 0;
layout(set = 0, binding = 0) readonly buffer Features { float features[]; };
layout(set = 0, binding = 1) readonly buffer Order { uvec2 order[]; };
layout(set = 0, binding = 2) readonly buffer Positions { vec4 positions[]; };
layout(set = 0, binding = 3) readonly buffer DMessages { float d_messages[]; };
layout(set = 0, binding = 4) writeonly buffer Turned { vec4 turned[]; };
layout(set = 0, binding = 5) writeonly buffer DTurned { float d_turned[]; };
layout(push_constant) uniform Push { PairGradientParameters p; };
#include "common/pair_edge.glsl"

void turn_features(uint slot, uint row, PairEdge sides, uint quad, bool inside) {
  const vec3 x1 = sides.source.axes[0], y1 = sides.source.axes[1], z1 = sides.source.axes[2];
  const vec3 x2 = sides.reference.axes[0], y2 = sides.reference.axes[1], z2 = sides.reference.axes[2];
  vec4 parts[16];
  [[unroll]] for (int lane = 0; lane < 4; ++lane) {
    const uint c = 4 * quad + lane;
    parts[0][lane] = c < IN0 ? features[row + c] : 0.0;
    const vec3 second = c < IN1 ? turn_into(vector_feature(row + FEATURE1 + 3u * c), x2, y2, z2) : vec3(0);
    const vec3 first = c < IN2 ? turn_into(vector_feature(row + FEATURE2 + 3u * c), x1, y1, z1) : vec3(0);
    vec3 both[3];
    [[unroll]] for (int a = 0; a < 3; ++a)
      both[a] = c < IN3 ? turn_into(vector_feature(row + FEATURE3 + 9u * c + 3u * a), x2, y2, z2) : vec3(0);
    [[unroll]] for (int a = 0; a < 3; ++a) {
      const vec3 along = a == 0 ? x1 : a == 1 ? y1 : z1;
      const vec3 turned_both = turn_back(along, both[0], both[1], both[2]);
      parts[1 + a][lane] = second[a];
      parts[4 * (1 + a)][lane] = first[a];
      [[unroll]] for (int b = 0; b < 3; ++b) parts[4 * (1 + a) + 1 + b][lane] = turned_both[b];
    }
  }
  if (inside) {
    [[unroll]] for (int i = 0; i < 16; ++i) turned[(i * IN4 + quad) * p.edges + slot] = parts[i];
  }
}

vec3 message_gradient(uint at) { return vec3(d_messages[at], d_messages[at + 1u], d_messages[at + 2u]); }

void turn_messages(uint slot, uint edge, PairEdge sides, uint o, bool inside) {
  const vec3 x1 = sides.source.axes[0], y1 = sides.source.axes[1], z1 = sides.source.axes[2];
  const vec3 x2 = sides.reference.axes[0], y2 = sides.reference.axes[1], z2 = sides.reference.axes[2];
  const uint at = edge * MESSAGE_STRIDE;
  if (inside && o < MESSAGES(0)) d_turned[o * p.edges + slot] = d_messages[at + o];
  if (inside && o < MESSAGES(1)) {
    const uint m = MESSAGE1 + 3 * o;
    const vec3 d = turn_into(message_gradient(at + m), x2, y2, z2);
    [[unroll]] for (int b = 0; b < 3; ++b) d_turned[(m + b) * p.edges + slot] = d[b];
  }
  if (inside && o < MESSAGES(2)) {
    const uint m = MESSAGE2 + 3 * o;
    const vec3 d = turn_into(message_gradient(at + m), x1, y1, z1);
    [[unroll]] for (int a = 0; a < 3; ++a) d_turned[(m + a) * p.edges + slot] = d[a];
  }
  if (inside && o < MESSAGES(3)) {
    const uint m = MESSAGE3 + 9 * o;
    vec3 d[3];
    [[unroll]] for (int a = 0; a < 3; ++a) d[a] = turn_into(message_gradient(at + m + 3 * a), x2, y2, z2);
    [[unroll]] for (int a = 0; a < 3; ++a) {
      const vec3 along = a == 0 ? x1 : a == 1 ? y1 : z1;
      const vec3 both = turn_back(along, d[0], d[1], d[2]);
      [[unroll]] for (int b = 0; b < 3; ++b) d_turned[(m + 3 * a + b) * p.edges + slot] = both[b];
    }
  }
}

void main() {
  const bool inside = gl_GlobalInvocationID.x < p.edges;
  const uint slot = min(gl_GlobalInvocationID.x, p.edges - 1u), item = gl_WorkGroupID.y;
  const uvec2 ends = order[slot];
  const PairEdge sides = pair_edge(p.first_node + ends.x / K, ends.y);
  if (item < IN4)
    turn_features(slot, ends.y * FEATURE_STRIDE, sides, item, inside);
  else
    turn_messages(slot, ends.x, sides, item - IN4, inside);
}
