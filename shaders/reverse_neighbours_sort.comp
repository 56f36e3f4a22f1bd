// reverse_neighbours_sort.comp: the lists in ascending order, an invocation per edge, which counts those before it.
// in  0 index    u32[Q,K]
// in  1 begins   u32[P]
// in  2 counts   u32[P]
// in  3 unsorted u32[Q·K]
// out 4 sorted   u32[Q·K]
// spec 0 WORKGROUP=128 | grid ceil(Q·K / WORKGROUP) | shared 0 KiB
// loops ≤ edges from a row < 65535 | error: exact | fp32
#version 450
#extension GL_GOOGLE_include_directive : require
#include "common/parameters.glsl"

layout(local_size_x_id = 0) in;
layout(set = 0, binding = 0) readonly buffer Index { uint index[]; };
layout(set = 0, binding = 1) readonly buffer Begins { uint begins[]; };
layout(set = 0, binding = 2) readonly buffer Counts { uint counts[]; };
layout(set = 0, binding = 3) readonly buffer Unsorted { uint unsorted[]; };
layout(set = 0, binding = 4) writeonly buffer Sorted { uint sorted[]; };
layout(push_constant) uniform Push { EdgeParameters p; };

void main() {
  const uint edge = p.first + gl_GlobalInvocationID.x;
  const uint row = index[min(edge, p.edges - 1u)];
  const uint first = begins[row], end = first + counts[row];
  uint rank = first;
  for (uint i = first; i < end; ++i) rank += unsorted[i] < edge ? 1u : 0u;
  if (edge < p.edges) sorted[rank] = edge;
}
