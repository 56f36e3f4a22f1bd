// knn_tree_levels.comp: the boxes of the nodes above the blocks, level by level, a work group per cloud.
// in  0 offsets u32[clouds+1]
// mod 1 boxes   f32[nodes,8]  low corner, 0, high corner, 0
// spec 0 WORKGROUP=128 | grid clouds | shared 0 KiB
// loops ≤ 9·(blocks/7/128 + 8) = 9·(2^17/7/128 + 8) = 1389 < 65535 | error: none | fp32
#version 450
#extension GL_GOOGLE_include_directive : require
#include "common/knn_tree.glsl"

layout(local_size_x_id = 0) in;
const uint LANES = 128;

layout(set = 0, binding = 0) readonly buffer Offsets { uint offsets[]; };
layout(set = 0, binding = 1) coherent buffer Boxes { vec4 boxes[]; };

void main() {
  const uint cloud = gl_WorkGroupID.x, begin = offsets[cloud];
  const uint blocks = cloud_blocks(begin, offsets[cloud + 1]);
  uint below = first_node(begin, cloud);
  for (uint level = 1; level_nodes(blocks, level - 1) > 1; ++level) {
    const uint children = level_nodes(blocks, level - 1), nodes = level_nodes(blocks, level);
    for (uint node = gl_LocalInvocationID.x; node < nodes; node += LANES) {
      vec3 low = boxes[2 * (below + 8 * node)].xyz, high = boxes[2 * (below + 8 * node) + 1].xyz;
      for (uint child = 8 * node + 1; child < min(8 * node + 8, children); ++child) {
        low = min(low, boxes[2 * (below + child)].xyz);
        high = max(high, boxes[2 * (below + child) + 1].xyz);
      }
      boxes[2 * (below + children + node)] = vec4(low, 0);
      boxes[2 * (below + children + node) + 1] = vec4(high, 0);
    }
    below += children;
    memoryBarrierBuffer();
    barrier();
  }
}
