// knn_tree_bounds.comp: the grid of every cloud, a work group per cloud: a cube that holds the bounding box, cut to
// three standard deviations around the mean so that a few outliers do not coarsen it for all others.
// in  0 points  f32[P,4]       xyz
// in  1 offsets u32[clouds+1]
// out 2 grids   f32[clouds,8]  origin, cell size; bits of a cell's coordinate (as bits), 0 0 0
// spec 0 WORKGROUP=128 | grid clouds | shared 6 KiB
// loops ≤ points/128 + 7·13 + 7 < 65535 | error: no neighbour depends on it | fp32
#version 450
#extension GL_GOOGLE_include_directive : require
#include "common/knn_tree.glsl"

layout(local_size_x_id = 0) in;
const uint LANES = 128;

layout(set = 0, binding = 0) readonly buffer Points { vec4 points[]; };
layout(set = 0, binding = 1) readonly buffer Offsets { uint offsets[]; };
layout(set = 0, binding = 2) writeonly buffer Grids { vec4 grids[]; };

shared float reduced[12][LANES];

void store(uint at, uint lane, vec3 v) {
  reduced[at][lane] = v.x, reduced[at + 1][lane] = v.y, reduced[at + 2][lane] = v.z;
}
vec3 load(uint at) { return vec3(reduced[at][0], reduced[at + 1][0], reduced[at + 2][0]); }

void main() {
  const uint cloud = gl_WorkGroupID.x, lane = gl_LocalInvocationID.x;
  const uint begin = offsets[cloud], end = offsets[cloud + 1];
  if (begin == end) return;
  const vec3 first = points[begin].xyz;
  vec3 low = vec3(0), high = vec3(0), sum = vec3(0), squares = vec3(0);
  for (uint row = begin + lane; row < end; row += LANES) {
    const vec3 p = points[row].xyz - first;
    low = min(low, p);
    high = max(high, p);
    sum += p;
    squares += p * p;
  }
  store(0, lane, low);
  store(3, lane, high);
  store(6, lane, sum);
  store(9, lane, squares);
  barrier();
  for (uint half_lanes = LANES / 2; half_lanes > 0; half_lanes /= 2) {
    if (lane < half_lanes) {
      for (uint i = 0; i < 12; ++i) {
        const float own = reduced[i][lane], other = reduced[i][lane + half_lanes];
        reduced[i][lane] = i < 3 ? min(own, other) : i < 6 ? max(own, other) : own + other;
      }
    }
    barrier();
  }
  if (lane > 0) return;

  const float count = float(end - begin);
  const vec3 mean = load(6) / count;
  const vec3 reach = 3.0 * sqrt(max(load(9) / count - mean * mean, vec3(0)));
  const vec3 from = max(load(0), mean - reach), extent = min(load(3), mean + reach) - from;
  uint bits = 0;
  while (bits < MOST_BITS && 1u << (3 * bits + 3) <= CELLS_PER_POINT * (end - begin)) ++bits;
  const float cell = max(extent.x, max(extent.y, extent.z)) / float(1u << bits);
  // Not a number, or nothing but one place: a single cell.
  const bool usable = cell > 0.0 && cell < 1e30;
  grids[2 * cloud] = usable ? vec4(first + from, cell) : vec4(0, 0, 0, 1);
  grids[2 * cloud + 1] = vec4(uintBitsToFloat(usable ? bits : 0u), 0, 0, 0);
}
