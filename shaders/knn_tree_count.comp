// knn_tree_count.comp: how many points each cell holds.
// in  0 points  f32[P,4]
// in  1 tiles   u32[tiles,4]
// in  2 offsets u32[clouds+1]
// in  3 grids   f32[clouds,8]
// mod 4 cells   u32[P·CELLS_PER_POINT]
// spec 0 WORKGROUP=32 | grid tiles | shared 0 KiB
// loops none | error: none | fp32
#version 450
#extension GL_GOOGLE_include_directive : require
#include "common/knn_tree.glsl"
#include "common/parameters.glsl"

layout(local_size_x_id = 0) in;

layout(set = 0, binding = 0) readonly buffer Points { vec4 points[]; };
layout(set = 0, binding = 1) readonly buffer Tiles { uvec4 tiles[]; };
layout(set = 0, binding = 2) readonly buffer Offsets { uint offsets[]; };
layout(set = 0, binding = 3) readonly buffer Grids { vec4 grids[]; };
layout(set = 0, binding = 4) buffer Cells { uint cells[]; };
layout(push_constant) uniform Push { TileParameters p; };

void main() {
  const uvec4 tile = tiles[p.first_tile + gl_WorkGroupID.x];
  const uint row = tile.y + gl_LocalInvocationID.x;
  if (row >= tile.z) return;
  const Grid grid = stored_grid(grids[2 * tile.x], grids[2 * tile.x + 1]);
  atomicAdd(cells[CELLS_PER_POINT * offsets[tile.x] + grid_index(grid, points[row].xyz)], 1);
}
