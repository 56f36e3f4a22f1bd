// pair_gradient_lists.comp: the edges of every sector of a radial table, in order, a work group per table and an
// invocation per sector.
// in  0 ids    u32[TABLES,E]
// out 1 begins u32[TABLES,SECTORS+1]
// out 2 lists  u32[TABLES,E]
// spec 0 WORKGROUP=64  1 SECTORS≤1024 | grid TABLES | shared 4 KiB
// loops ≤ (2·E + SECTORS)·⌈SECTORS / WORKGROUP⌉ < 65535, as src/vk/pair_attention_gradient.cpp sees to
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

const uint LANES = gl_WorkGroupSize.x;
shared uint counts[SECTORS];

void main() {
  const uint table = gl_WorkGroupID.x, lane = gl_LocalInvocationID.x, first = table * p.edges;
  for (uint s = lane; s < SECTORS; s += LANES) {
    uint count = 0u;
    for (uint e = 0; e < p.edges; ++e) count += ids[first + e] == s ? 1u : 0u;
    counts[s] = count;
  }
  barrier();
  for (uint s = lane; s < SECTORS; s += LANES) {
    uint at = 0u;
    for (uint before = 0; before < s; ++before) at += counts[before];
    begins[table * (SECTORS + 1u) + s] = at;
    if (s + 1u == SECTORS) begins[table * (SECTORS + 1u) + SECTORS] = at + counts[s];
    for (uint e = 0; e < p.edges; ++e)
      if (ids[first + e] == s) {
        lists[first + at] = e;
        ++at;
      }
  }
}
