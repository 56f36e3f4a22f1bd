// knn_tree_scatter.comp: sorts the points along the Morton curve. Their order within a cell differs from run to run;
// the neighbours found do not depend on it.
// in  0 points  f32[P,4]
// in  1 tiles   u32[tiles,4]
// in  2 offsets u32[clouds+1]
// in  3 grids   f32[clouds,8]
// mod 4 cells   u32[P·CELLS_PER_POINT]
// out 5 sorted  u32[P,4]  xyz as bits, the point's row
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
layout(set = 0, binding = 5) writeonly buffer Sorted { uvec4 sorted[]; };
layout(push_constant) uniform Push { TileParameters p; };

void main() {
  const uvec4 tile = tiles[p.first_tile + gl_WorkGroupID.x];
  const uint row = tile.y + gl_LocalInvocationID.x;
  if (row >= tile.z) return;
  const Grid grid = stored_grid(grids[2 * tile.x], grids[2 * tile.x + 1]);
  const vec3 point = points[row].xyz;
  const uint at = atomicAdd(cells[CELLS_PER_POINT * offsets[tile.x] + grid_index(grid, point)], 1);
  sorted[at] = uvec4(floatBitsToUint(point), row);
}
