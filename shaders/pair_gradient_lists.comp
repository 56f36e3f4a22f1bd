// pair_gradient_lists.comp: the edges of every sector of a radial table, in order, a work group per table, of which PARTS
// invocations take so many edges in a row.
// in  0 ids    u32[TABLES,E]
// out 1 begins u32[TABLES,SECTORS+1]
// out 2 lists  u32[TABLES,E]
// spec 0 WORKGROUP=32  1 SECTORS≤1024 | grid TABLES | shared 12.1 KiB
// loops ≤ 2·⌈E / PARTS⌉ + SECTORS + 2·2048 < 65535, as src/vk/pair_attention_gradient.cpp sees to
// error: exact | fp32
#version 450
#extension GL_GOOGLE_include_directive : require
#include "common/parameters.glsl"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const uint SECTORS = 64;
layout(set = 0, binding = 0) readonly buffer Ids { uint ids[]; };
layout(set = 0, binding = 1) writeonly buffer Begins { uint begins[]; };
layout(set = 0, binding = 2) writeonly buffer Lists { uint lists[]; };
layout(push_constant) uniform Push { PairGradientParameters p; };

const uint LANES = gl_WorkGroupSize.x, PLACES = 2048;
const uint PARTS = PLACES / SECTORS < 32u ? PLACES / SECTORS : 32u;
shared uint places[PLACES];  // by sector and part: how many edges, then where the next one goes
shared uint totals[SECTORS];

void main() {
  const uint table = gl_WorkGroupID.x, lane = gl_LocalInvocationID.x, first = table * p.edges;
  const uint size = (p.edges + PARTS - 1u) / PARTS;
  const uint begin = min(lane * size, p.edges), end = lane < PARTS ? min(begin + size, p.edges) : begin;
  for (uint i = lane; i < PLACES; i += LANES) places[i] = 0u;
  barrier();
  for (uint e = begin; e < end; ++e) ++places[ids[first + e] * PARTS + lane];
  barrier();
  for (uint s = lane; s < SECTORS; s += LANES) {
    uint total = 0u;
    for (uint i = 0; i < PARTS; ++i) total += places[s * PARTS + i];
    totals[s] = total;
  }
  barrier();
  for (uint s = lane; s < SECTORS; s += LANES) {
    uint at = 0u;
    for (uint before = 0; before < s; ++before) at += totals[before];
    begins[table * (SECTORS + 1u) + s] = at;
    if (s + 1u == SECTORS) begins[table * (SECTORS + 1u) + SECTORS] = at + totals[s];
    for (uint i = 0; i < PARTS; ++i) {
      const uint count = places[s * PARTS + i];
      places[s * PARTS + i] = at;
      at += count;
    }
  }
  barrier();
  for (uint e = begin; e < end; ++e) {
    const uint place = ids[first + e] * PARTS + lane;
    lists[first + places[place]] = e;
    ++places[place];
  }
}
