// merge_pairs.comp: key point c of a source and of its reference become a node of the 6-D graph; see
// src/ops/merge_pairs.hpp.
// in  0 positions   f32[2B·K,4]  xyz; sources' key points, then references'
// in  1 features    f32[2B·K,W4] W = CHANNELS · (1 + 3), padded to a multiple of 4
// out 2 node        f32[B·K,8]   xyz of both
// out 3 merged      f32[B·K,16·CHANNELS]
// spec 0 WORKGROUP=32  1 CHANNELS | grid ceil(B·K·16·CHANNELS / WORKGROUP), in parts | shared 0 KiB
// loops none | error: see src/ops/merge_pairs.hpp | fp32
#version 450
#extension GL_GOOGLE_include_directive : require
#include "common/parameters.glsl"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const uint CHANNELS = 4;

const uint FEATURE_STRIDE = 4 * CHANNELS;
const uint WIDTH = 16 * CHANNELS;

layout(set = 0, binding = 0) readonly buffer Positions { float positions[]; };
layout(set = 0, binding = 1) readonly buffer Features { float features[]; };
layout(set = 0, binding = 2) writeonly buffer Node { float node_position[]; };
layout(set = 0, binding = 3) writeonly buffer Merged { float merged[]; };
layout(push_constant) uniform Push { MergeParameters p; };

void main() {
  const uint item = p.first_item + gl_GlobalInvocationID.x;
  const uint node = item / WIDTH, column = item % WIDTH;
  if (node >= p.nodes) return;
  const uint source = node * FEATURE_STRIDE, reference = (node + p.nodes) * FEATURE_STRIDE;

  // Degrees in order: (0,0), (0,1), (1,0), (1,1).
  float value;
  if (column < CHANNELS) {
    value = features[source + column] + features[reference + column];
  } else if (column < 4 * CHANNELS) {
    value = features[reference + column];
  } else if (column < 7 * CHANNELS) {
    value = features[source + column - 3 * CHANNELS];
  } else {
    const uint entry = column - 7 * CHANNELS, channel = entry / 9, i = entry % 9 / 3, j = entry % 3;
    value = features[source + CHANNELS + 3 * channel + i] * features[reference + CHANNELS + 3 * channel + j];
  }
  merged[item] = value;

  if (column < 8) {
    const uint row = column < 3 ? node : node + p.nodes;
    node_position[node * 8 + column] = column < 6 ? positions[row * 4 + column % 3] : 0.0;
  }
}
