// reverse_neighbours_clear.comp: before reverse_neighbours_count.comp, an invocation per neighbour row.
// out 0 counts u32[P]
// spec 0 WORKGROUP=128 | grid ceil(P / WORKGROUP) | shared 0 KiB
// loops none | error: exact | fp32
#version 450
#extension GL_GOOGLE_include_directive : require
#include "common/parameters.glsl"

layout(local_size_x_id = 0) in;
layout(set = 0, binding = 0) writeonly buffer Counts { uint counts[]; };
layout(push_constant) uniform Push { EdgeParameters p; };

void main() {
  const uint i = p.first + gl_GlobalInvocationID.x;
  if (i < p.edges) counts[i] = 0u;
}
