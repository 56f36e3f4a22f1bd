// outer_totals.comp: what outer_sums.comp leaves of every tile, summed over all tiles, or over those of a segment, and
// put in the order of a result; an invocation per number.
// in  0 partials f32[tiles,jobs,16]
// in  1 tiles    u32[tiles,4]
// in  2 places   u32[NUMBERS] of each number within a tile's partial sums, or NONE
// out 3 result   f32[S,R]    NUMBERS of each row, or of one row from `begin` on
// spec 0 WORKGROUP=32  1 NUMBERS  2 SEGMENTED | grid (ceil(NUMBERS / WORKGROUP), segments) | shared 0 KiB
// loops ≤ tiles + 40 < 65535, as src/vk/outer_sums.cpp sees to | error: see src/ops/gradient.hpp | fp32
#version 450
#extension GL_GOOGLE_include_directive : require
#include "common/parameters.glsl"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const uint NUMBERS = 4;  // in a row, padded
layout(constant_id = 2) const bool SEGMENTED = false;
const uint NONE = 0xffffffffu;

layout(set = 0, binding = 0) readonly buffer Partials { float partials[]; };
layout(set = 0, binding = 1) readonly buffer Tiles { uvec4 tiles[]; };
layout(set = 0, binding = 2) readonly buffer Places { uint places[]; };
layout(set = 0, binding = 3) writeonly buffer Result { float result[]; };
layout(push_constant) uniform Push { OuterTotalParameters p; };

// The first tile of a segment, or of the first one after it that has tiles.
uint first_tile(uint segment) {
  uint low = 0u, high = p.tiles;
  for (int i = 0; i < 17 && low < high; ++i) {
    const uint middle = (low + high) / 2u;
    if (tiles[middle].x < segment)
      low = middle + 1u;
    else
      high = middle;
  }
  return low;
}

void main() {
  const uint number = gl_GlobalInvocationID.x, segment = p.first_segment + gl_WorkGroupID.y;
  const uint first = SEGMENTED ? first_tile(segment) : 0u, end = SEGMENTED ? first_tile(segment + 1u) : p.tiles;
  const uint place = places[min(number, NUMBERS - 1u)];
  float sum = 0.0;
  if (place != NONE)
    for (uint t = first; t < end; ++t) sum += partials[t * p.jobs * 16u + place];
  if (number < NUMBERS) result[p.begin + segment * NUMBERS + number] = sum;
}
