// knn_tree_clear.comp: empties every cell of the grids.
// in  0 tiles u32[tiles,4]
// out 1 cells u32[P·CELLS_PER_POINT]  cloud c owns cells from CELLS_PER_POINT times its first row
// spec 0 WORKGROUP=32 | grid tiles | shared 0 KiB
// loops none | error: none | fp32
#version 450
#extension GL_EXT_control_flow_attributes : require
#extension GL_GOOGLE_include_directive : require
#include "common/knn_tree.glsl"
#include "common/parameters.glsl"

layout(local_size_x_id = 0) in;

layout(set = 0, binding = 0) readonly buffer Tiles { uvec4 tiles[]; };
layout(set = 0, binding = 1) writeonly buffer Cells { uint cells[]; };
layout(push_constant) uniform Push { TileParameters p; };

void main() {
  const uvec4 tile = tiles[p.first_tile + gl_WorkGroupID.x];
  const uint row = tile.y + gl_LocalInvocationID.x;
  if (row >= tile.z) return;
  [[unroll]] for (uint i = 0; i < CELLS_PER_POINT; ++i) cells[CELLS_PER_POINT * row + i] = 0;
}
