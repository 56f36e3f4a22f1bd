// knn_tree_scan.comp: from the number of points of each cell to the row where they begin, a work group per cloud.
// in  0 offsets u32[clouds+1]
// in  1 grids   f32[clouds,8]
// mod 2 cells   u32[P·CELLS_PER_POINT]
// spec 0 WORKGROUP=128 | grid clouds | shared 0.5 KiB
// loops ≤ 2·8^MOST_BITS/128 + 128 = 32896 < 65535 | error: none | fp32
#version 450
#extension GL_GOOGLE_include_directive : require
#include "common/knn_tree.glsl"

layout(local_size_x_id = 0) in;
const uint LANES = 128;

layout(set = 0, binding = 0) readonly buffer Offsets { uint offsets[]; };
layout(set = 0, binding = 1) readonly buffer Grids { vec4 grids[]; };
layout(set = 0, binding = 2) buffer Cells { uint cells[]; };

shared uint totals[LANES];

void main() {
  const uint cloud = gl_WorkGroupID.x, lane = gl_LocalInvocationID.x;
  if (offsets[cloud] == offsets[cloud + 1]) return;  // without cells of its own
  const Grid grid = stored_grid(grids[2 * cloud], grids[2 * cloud + 1]);
  const uint count = 1u << (3 * grid.bits);
  const uint share = (count + LANES - 1) / LANES;
  const uint base = CELLS_PER_POINT * offsets[cloud];
  const uint begin = base + min(lane * share, count), end = base + min((lane + 1) * share, count);

  uint total = 0;
  for (uint i = begin; i < end; ++i) total += cells[i];
  totals[lane] = total;
  barrier();
  uint row = offsets[cloud];
  for (uint i = 0; i < lane; ++i) row += totals[i];
  for (uint i = begin; i < end; ++i) {
    const uint points = cells[i];
    cells[i] = row;
    row += points;
  }
}
