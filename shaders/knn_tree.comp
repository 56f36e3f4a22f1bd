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
const int BATCH = 8;
const uint MOST_LOOPS = 20000;
#define INFINITY uintBitsToFloat(0x7f800000u)

layout(set = 0, binding = 0) readonly buffer Sorted { uvec4 sorted[]; };
layout(set = 0, binding = 1) readonly buffer Tiles { uvec4 tiles[]; };
layout(set = 0, binding = 2) readonly buffer Offsets { uint offsets[]; };
layout(set = 0, binding = 3) readonly buffer Boxes { vec4 boxes[]; };
layout(set = 0, binding = 4) writeonly buffer Index { uint index[]; };
layout(set = 0, binding = 5) writeonly buffer Points { vec4 points[]; };
layout(push_constant) uniform Push { PointParameters p; };

bool before(float d, uint row, float other, uint other_row) {
  return d < other || (d == other && row < other_row);
}

// Never contracted into fused multiply-adds: ties must be ties on every device, and no box farther than a point
// in it.
float squared(vec3 difference) {
  precise vec3 square = difference * difference;
  precise float sum = square.x + square.y;
  sum = sum + square.z;
  return sum;
}

// True where the node has to be looked at.
bool any_reached(bool reached) {
#ifdef SHUFFLE
  return subgroupAny(reached);
#else
  return reached;
#endif
}

uvec4 candidate(uvec4 loaded, uint slot, int i) {
#ifdef SHUFFLE
  return subgroupShuffle(loaded, i);
#else
  return sorted[slot];
#endif
}

void main() {
  const uvec4 tile = tiles[p.first_tile + gl_WorkGroupID.x];
  const uint slot = min(tile.y + gl_LocalInvocationID.x, tile.z - 1);
  const uint begin = offsets[tile.x], end = offsets[tile.x + 1];
  const uint blocks = cloud_blocks(begin, end);
  const vec3 query = uintBitsToFloat(sorted[slot].xyz);
  const uint query_row = sorted[slot].w;

  float nearest[NEAREST];
  uint nearest_row[NEAREST];
  [[unroll]] for (int j = 0; j < NEAREST; ++j) {
    nearest[j] = INFINITY;
    nearest_row[j] = begin;
  }

  uint top = 0, level_first = first_node(begin, tile.x);
  while (level_nodes(blocks, top) > 1) {
    level_first += level_nodes(blocks, top);
    ++top;
  }

  // Rows still to look at; the walk goes on when there are none. First the query's block and those beside it, which
  // leaves the walk a short reach.
  uint base = max(tile.y, begin + BLOCK) - BLOCK, block_end = min(tile.z + BLOCK, end);
  uint level = top, node = 0;
  uint steps = 0, insertions = 0;
  for (; steps < MOST_LOOPS; ++steps) {
    if (base >= block_end) {
      if (node >= level_nodes(blocks, level)) {
        if (level == top) break;
        level_first += level_nodes(blocks, level);
        ++level;
        node = node / 8 + 1;
        continue;
      }
      const vec3 low = boxes[2 * (level_first + node)].xyz, high = boxes[2 * (level_first + node) + 1].xyz;
      precise vec3 below = low - query, above = query - high;
      const bool reached = any_reached(squared(max(max(below, above), vec3(0))) <= nearest[NEAREST - 1]);
      if (reached && level > 0) {
        --level;
        level_first -= level_nodes(blocks, level);
        node *= 8;
        continue;
      }
      if (reached && (node + 1 < tile.w || node > tile.w + 1)) {
        base = begin + node * BLOCK;
        block_end = min(base + BLOCK, end);
      }
      ++node;
      while (node % 8 == 0 && level < top) {
        level_first += level_nodes(blocks, level);
        ++level;
        node /= 8;
      }
      continue;
    }

    float d[BATCH];
    uint rows[BATCH];
#ifdef SHUFFLE
    const uvec4 loaded = sorted[min(base + (gl_SubgroupInvocationID & 7u), block_end - 1)];
#else
    const uvec4 loaded = uvec4(0);
#endif
    [[unroll]] for (int i = 0; i < BATCH; ++i) {
      const uvec4 point = candidate(loaded, min(base + i, block_end - 1), i);
      precise vec3 difference = query - uintBitsToFloat(point.xyz);
      rows[i] = point.w;
      d[i] = base + i < block_end && point.w != query_row ? squared(difference) : INFINITY;
    }
    base += BATCH;
    for (; insertions < MOST_LOOPS; ++insertions) {
      float least = INFINITY;
      uint found = 0xffffffffu;
      [[unroll]] for (int i = 0; i < BATCH; ++i) {
        const bool first = before(d[i], rows[i], least, found);
        found = first ? rows[i] : found;
        least = first ? d[i] : least;
      }
      if (least == INFINITY || !before(least, found, nearest[NEAREST - 1], nearest_row[NEAREST - 1])) break;
      [[unroll]] for (int j = NEAREST - 1; j > 0; --j) {
        const bool shift = before(least, found, nearest[j - 1], nearest_row[j - 1]);
        const bool here = before(least, found, nearest[j], nearest_row[j]);
        nearest_row[j] = shift ? nearest_row[j - 1] : here ? found : nearest_row[j];
        nearest[j] = shift ? nearest[j - 1] : here ? least : nearest[j];
      }
      if (before(least, found, nearest[0], nearest_row[0])) {
        nearest[0] = least;
        nearest_row[0] = found;
      }
      [[unroll]] for (int i = 0; i < BATCH; ++i) d[i] = rows[i] == found ? INFINITY : d[i];
    }
  }

  if (tile.y + gl_LocalInvocationID.x < tile.z) {
    [[unroll]] for (int j = 0; j < K; ++j)
      index[(query_row - p.first_row) * K + j] = nearest_row[(j + 1) * DILATION - 1];
    // Tens of thousands of points in one cell: an error rather than a wrong answer.
    if (max(steps, insertions) >= MOST_LOOPS) points[query_row] = vec4(uintBitsToFloat(0x7fc00000u));
  }
}
