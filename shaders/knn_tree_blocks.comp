// knn_tree_blocks.comp: the box around each block of sorted points, a work group per block.
// in  0 sorted  u32[P,4]      xyz as bits, the point's row
// in  1 tiles   u32[tiles,4]
// in  2 offsets u32[clouds+1]
// out 3 boxes   f32[nodes,8]  low corner, 0, high corner, 0
// spec 0 WORKGROUP=32 | grid tiles | shared 0 KiB
// loops ≤ BLOCK = 32 < 65535 | error: none | fp32
#version 450
#extension GL_GOOGLE_include_directive : require
#include "common/knn_tree.glsl"
#include "common/parameters.glsl"

layout(local_size_x_id = 0) in;

layout(set = 0, binding = 0) readonly buffer Sorted { uvec4 sorted[]; };
layout(set = 0, binding = 1) readonly buffer Tiles { uvec4 tiles[]; };
layout(set = 0, binding = 2) readonly buffer Offsets { uint offsets[]; };
layout(set = 0, binding = 3) writeonly buffer Boxes { vec4 boxes[]; };
layout(push_constant) uniform Push { TileParameters p; };

void main() {
  if (gl_LocalInvocationID.x > 0) return;
  const uvec4 tile = tiles[p.first_tile + gl_WorkGroupID.x];
  vec3 low = uintBitsToFloat(sorted[tile.y].xyz), high = low;
  for (uint row = tile.y + 1; row < tile.z; ++row) {
    const vec3 point = uintBitsToFloat(sorted[row].xyz);
    low = min(low, point);
    high = max(high, point);
  }
  const uint node = first_node(offsets[tile.x], tile.x) + tile.w;
  boxes[2 * node] = vec4(low, 0);
  boxes[2 * node + 1] = vec4(high, 0);
}
