// reverse_neighbours_scan.comp: where the list of each row begins, a work group per cloud: behind those of the rows
// before it, and of the clouds before, whose edges are K for each of their rows that have neighbours.
// in  0 counts  u32[P]
// in  1 offsets u32[clouds+1] first row of every cloud
// in  2 rows    u32[clouds+1] first of the rows that have neighbours
// out 3 begins  u32[P]
// spec 0 WORKGROUP=128  1 K≤64 | grid clouds | shared 0.5 KiB
// loops ≤ 2·P / WORKGROUP + WORKGROUP < 65535 | error: exact | fp32
#version 450
#extension GL_GOOGLE_include_directive : require
#include "common/parameters.glsl"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const uint K = 24;
layout(set = 0, binding = 0) readonly buffer Counts { uint counts[]; };
layout(set = 0, binding = 1) readonly buffer Offsets { uint offsets[]; };
layout(set = 0, binding = 2) readonly buffer RowOffsets { uint rows[]; };
layout(set = 0, binding = 3) writeonly buffer Begins { uint begins[]; };
layout(push_constant) uniform Push { SegmentParameters p; };

const uint LANES = gl_WorkGroupSize.x;
shared uint sums[LANES];

void main() {
  const uint cloud = p.first + gl_WorkGroupID.x, lane = gl_LocalInvocationID.x;
  const uint end = offsets[cloud + 1], part = (end - offsets[cloud] + LANES - 1) / LANES;
  const uint first = min(offsets[cloud] + lane * part, end), last = min(first + part, end);
  uint sum = 0u;
  for (uint i = first; i < last; ++i) sum += counts[i];
  sums[lane] = sum;
  barrier();
  uint at = rows[cloud] * K;
  for (uint i = 0; i < LANES; ++i) at += i < lane ? sums[i] : 0u;
  for (uint i = first; i < last; ++i) {
    begins[i] = at;
    at += counts[i];
  }
}
