// nearest.comp: for points that lie anywhere, the exact K nearest of another cloud's; see src/vk/nearest.hpp. Queries that
// are neighbours go together, as in knn_tree.comp.
// in  0 queries f32[Q,4]      xyz of the moved points, in the frame and scale of the cloud they look in
// in  1 tiles   u32[tiles,4]  cloud, first query, query past the last, 0
// in  2 clouds  u32[clouds,4] first slot, slot past the last, first node, 0
// in  3 sorted  u32[P,4]      xyz as bits, the point's row in its cloud
// in  4 boxes   f32[nodes,8]  low corner, 0, high corner, 0
// out 5 index   u32[Q,K]      rows, ascending (distance, row); 0xffffffff where there are fewer, or the search gave up
// spec 0 WORKGROUP=32  1 K≤16 | grid tiles | shared 0 KiB
// loops ≤ 3·MOST_LOOPS + 100 = 60100 < 65535 | error: indices equal to a search in double but for ties | fp32
#version 450
#extension GL_EXT_control_flow_attributes : require
#extension GL_GOOGLE_include_directive : require
#ifdef SHUFFLE
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_shuffle : require
#extension GL_KHR_shader_subgroup_vote : require
#endif
#include "common/knn_tree.glsl"
#include "common/parameters.glsl"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const int K = 16;

const int NEAREST = K;
const uint NONE = 0xffffffffu;

layout(set = 0, binding = 0) readonly buffer Queries { vec4 queries[]; };
layout(set = 0, binding = 1) readonly buffer Tiles { uvec4 tiles[]; };
layout(set = 0, binding = 2) readonly buffer Clouds { uvec4 clouds[]; };
layout(set = 0, binding = 3) readonly buffer Sorted { uvec4 sorted[]; };
layout(set = 0, binding = 4) readonly buffer Boxes { vec4 boxes[]; };
layout(set = 0, binding = 5) writeonly buffer Index { uint index[]; };
layout(push_constant) uniform Push { TileParameters p; };

#include "common/knn_walk.glsl"

// From the tree's top always to the nearer child.
uint nearest_block(vec3 query, uint blocks, uint first_node) {
  uint level = 0, level_first = first_node;
  while (level_nodes(blocks, level) > 1) {
    level_first += level_nodes(blocks, level);
    ++level;
  }
  uint node = 0;
  while (level > 0) {
    --level;
    level_first -= level_nodes(blocks, level);
    const uint first = 8 * node, end = min(first + 8, level_nodes(blocks, level));
    float least = INFINITY;
    node = first;
    for (uint child = first; child < end; ++child) {
      const float d = squared_to_box(query, level_first + child);
      if (d < least) {
        least = d;
        node = child;
      }
    }
  }
  return node;
}

void main() {
  const uvec4 tile = tiles[p.first_tile + gl_WorkGroupID.x];
  const uint row = min(tile.y + gl_LocalInvocationID.x, tile.z - 1);
  const uvec4 cloud = clouds[tile.x];
  const uint home = nearest_block(queries[(tile.y + tile.z) / 2].xyz, cloud_blocks(cloud.x, cloud.y), cloud.z);
  const bool done =
      find_nearest(queries[row].xyz, NONE, cloud.x, cloud.y, cloud.z, uvec2(home, home + 1));

  if (tile.y + gl_LocalInvocationID.x < tile.z) {
    [[unroll]] for (int j = 0; j < K; ++j)
      index[row * K + j] = done && nearest[j] < INFINITY ? nearest_row[j] : NONE;
  }
}
