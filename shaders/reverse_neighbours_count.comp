// reverse_neighbours_count.comp: how many edges come from each row, and a place for each of these edges among them, in
// no order. An invocation per edge.
// in  0 index  u32[Q,K]
// mod 1 counts u32[P]
// out 2 places u32[Q,K]
// spec 0 WORKGROUP=128 | grid ceil(Q·K / WORKGROUP) | shared 0 KiB
// loops none | error: exact | fp32
#version 450
#extension GL_GOOGLE_include_directive : require
#include "common/parameters.glsl"

layout(local_size_x_id = 0) in;
layout(set = 0, binding = 0) readonly buffer Index { uint index[]; };
layout(set = 0, binding = 1) buffer Counts { uint counts[]; };
layout(set = 0, binding = 2) writeonly buffer Places { uint places[]; };
layout(push_constant) uniform Push { EdgeParameters p; };

void main() {
  const uint edge = p.first + gl_GlobalInvocationID.x;
  if (edge < p.edges) places[edge] = atomicAdd(counts[index[edge]], 1u);
}
