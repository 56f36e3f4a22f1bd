// knn_tree.comp: exact k nearest neighbours of every point within its cloud, for large clouds: the query's own block
// and its neighbours first, then every node whose box the k-th distance reaches. Queries go along the Morton curve, so that neighbouring
// invocations walk the same nodes; with subgroups they walk together, and candidates travel by shuffle.
// in  0 sorted  u32[P,4]      xyz as bits, the point's row
// in  1 tiles   u32[tiles,4]
// in  2 offsets u32[clouds+1]
// in  3 boxes   f32[nodes,8]  low corner, 0, high corner, 0
// out 4 index   u32[P,K]      ascending (distance, index); ties → lower index; of the nearest K · DILATION, every
//                             DILATION-th; K · DILATION ≤ 128
// out 5 points  f32[P,4]      made non-finite where the search gave up, so that no result survives it
// spec 0 WORKGROUP=32  1 K≤64  2 DILATION≤16 | grid tiles | shared 0 KiB
// loops ≤ 3·MOST_LOOPS + 8 = 60008 < 65535 | error: indices equal to cpu/knn | fp32
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
layout(constant_id = 1) const int K = 24;
layout(constant_id = 2) const int DILATION = 1;

const int NEAREST = K * DILATION;
layout(set = 0, binding = 0) readonly buffer Sorted { uvec4 sorted[]; };
layout(set = 0, binding = 1) readonly buffer Tiles { uvec4 tiles[]; };
layout(set = 0, binding = 2) readonly buffer Offsets { uint offsets[]; };
layout(set = 0, binding = 3) readonly buffer Boxes { vec4 boxes[]; };
layout(set = 0, binding = 4) writeonly buffer Index { uint index[]; };
layout(set = 0, binding = 5) writeonly buffer Points { vec4 points[]; };
layout(push_constant) uniform Push { PointParameters p; };

#include "common/knn_walk.glsl"

void main() {
  const uvec4 tile = tiles[p.first_tile + gl_WorkGroupID.x];
  const uint slot = min(tile.y + gl_LocalInvocationID.x, tile.z - 1);
  const uint begin = offsets[tile.x], end = offsets[tile.x + 1];
  const uint query_row = sorted[slot].w;
  // The query's block and those beside it.
  const uvec2 known = uvec2(max(tile.w, 1) - 1, min(tile.w + 2, cloud_blocks(begin, end)));
  const bool done = find_nearest(uintBitsToFloat(sorted[slot].xyz), query_row, begin, end,
                                 first_node(begin, tile.x), known);

  if (tile.y + gl_LocalInvocationID.x < tile.z) {
    [[unroll]] for (int j = 0; j < K; ++j)
      index[(query_row - p.first_row) * K + j] = nearest_row[(j + 1) * DILATION - 1];
    // An error rather than a wrong answer.
    if (!done) points[query_row] = vec4(uintBitsToFloat(0x7fc00000u));
  }
}
