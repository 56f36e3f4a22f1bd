// reverse_neighbours_fill.comp: the lists of the edges that come from each row, in no order. An invocation per edge.
// in  0 index    u32[Q,K]
// in  1 begins   u32[P]
// in  2 places   u32[Q,K]
// out 3 unsorted u32[Q·K]
// spec 0 WORKGROUP=128 | grid ceil(Q·K / WORKGROUP) | shared 0 KiB
// loops none | error: exact | fp32
#version 450
#extension GL_GOOGLE_include_directive : require
#include "common/parameters.glsl"

layout(local_size_x_id = 0) in;
layout(set = 0, binding = 0) readonly buffer Index { uint index[]; };
layout(set = 0, binding = 1) readonly buffer Begins { uint begins[]; };
layout(set = 0, binding = 2) readonly buffer Places { uint places[]; };
layout(set = 0, binding = 3) writeonly buffer Unsorted { uint unsorted[]; };
layout(push_constant) uniform Push { EdgeParameters p; };

void main() {
  const uint edge = p.first + gl_GlobalInvocationID.x;
  if (edge < p.edges) unsorted[begins[index[edge]] + places[edge]] = edge;
}
