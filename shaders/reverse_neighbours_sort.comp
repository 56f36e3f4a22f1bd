// reverse_neighbours_sort.comp: the lists in ascending order, an invocation per row, which counts what goes before each of
// its edges: of at most MOST edges they are all at hand.
// in  0 begins   u32[P]
// in  1 counts   u32[P]
// in  2 unsorted u32[Q·K]
// out 3 sorted   u32[Q·K]
// spec 0 WORKGROUP=128 | grid ceil(P / WORKGROUP) | shared 0 KiB
// loops ≤ edges from a row, squared where there are more than MOST < 65535 | error: exact | fp32
#version 450
#extension GL_EXT_control_flow_attributes : require
#extension GL_GOOGLE_include_directive : require
#include "common/parameters.glsl"

layout(local_size_x_id = 0) in;
layout(set = 0, binding = 0) readonly buffer Begins { uint begins[]; };
layout(set = 0, binding = 1) readonly buffer Counts { uint counts[]; };
layout(set = 0, binding = 2) readonly buffer Unsorted { uint unsorted[]; };
layout(set = 0, binding = 3) writeonly buffer Sorted { uint sorted[]; };
layout(push_constant) uniform Push { EdgeParameters p; };

const uint MOST = 64;

void main() {
  const uint row = p.first + gl_GlobalInvocationID.x;
  const uint begin = begins[min(row, p.edges - 1u)], count = row < p.edges ? counts[row] : 0u;
  uint edges[MOST];
  [[unroll]] for (uint i = 0; i < MOST; ++i)
    edges[i] = i < count ? unsorted[begin + min(i, count - 1u)] : 0xffffffffu;
  for (uint i = 0; i < count; ++i) {
    const uint edge = unsorted[begin + i];
    uint rank = 0u;
    [[unroll]] for (uint other = 0; other < MOST; ++other) rank += edges[other] < edge ? 1u : 0u;
    for (uint other = MOST; other < count; ++other) rank += unsorted[begin + other] < edge ? 1u : 0u;
    sorted[begin + rank] = edge;
  }
}
