// pair_gradient_tables.comp: what a radial table makes of an edge's lengths, an invocation per edge, in their order, and
// table; the lengths themselves in place of one more table. Where a norm's eps would matter nothing is made.
// in  0 order     u32[N·K,2]     of the run's edges: edge, neighbour
// in  1 positions f32[B·KEYS,8]  xyz of the source, xyz of the reference, 0 0
// con 2 heads     u32[TABLES,12] this and the next two: common/pair_tables.glsl
// in  3 rays      f32[R]
// in  4 sectors   f32[S,4]
// out 5 factors   f32[TABLES+1,N·K,4] of the columns
// out 6 ids       u32[TABLES,N·K] of the sectors
// spec 0 WORKGROUP=32  1 K≤64  2 THIRD  3–6 IN  7–10 VALUES  11–14 KEYS  15 LINEAR  16 SEARCH≤16
// grid (ceil(N·K / WORKGROUP), TABLES + 1) | shared 0 KiB
// loops ≤ SEARCH < 65535 | error: see src/ops/gradient.hpp | fp32
#version 450
#extension GL_GOOGLE_include_directive : require
#include "common/pair_layer.glsl"
#include "common/parameters.glsl"
#include "common/texels.glsl"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const uint K = 24;
layout(constant_id = 2) const uint THIRD = 0;
layout(set = 0, binding = 0) readonly buffer Order { uvec2 order[]; };
READ_VEC4S(1, Positions);
layout(set = 0, binding = 2) uniform Heads { uvec4 heads[3 * TABLES]; };
layout(set = 0, binding = 3) readonly buffer Rays { float rays[]; };
READ_VEC4S(4, Sectors);
layout(set = 0, binding = 5) writeonly buffer Factors { vec4 factors[]; };
layout(set = 0, binding = 6) writeonly buffer Ids { uint ids[]; };
layout(push_constant) uniform Push { PairGradientParameters p; };
#define SECTOR(at) VEC4_OF(Sectors, at)
#include "common/pair_tables.glsl"

void main() {
  const bool inside = gl_GlobalInvocationID.x < p.edges;
  const uint edge = min(gl_GlobalInvocationID.x, p.edges - 1u), slot = gl_WorkGroupID.y;
  const uint centre = p.first_node + order[edge].x / K, neighbour = order[edge].y;
  const vec4 centre0 = VEC4_OF(Positions, 2u * centre), centre1 = VEC4_OF(Positions, 2u * centre + 1u);
  const vec4 neighbour0 = VEC4_OF(Positions, 2u * neighbour), neighbour1 = VEC4_OF(Positions, 2u * neighbour + 1u);
  const vec3 d1 = centre0.xyz - neighbour0.xyz, d2 = vec3(centre0.w, centre1.xy) - vec3(neighbour0.w, neighbour1.xy);
  const vec2 lengths = vec2(sqrt(dot(d1, d1)), sqrt(dot(d2, d2)));
  const uint table = min(slot, uint(TABLES) - 1u);
  const RadialInput found = radial_input(table, lengths);
  const uvec4 head = heads[3 * table];
  const uint form = (head.w & DEGREE1) != 0u ? 0u : 2u;
  if (inside) {
    factors[slot * p.edges + edge] = slot == TABLES ? vec4(lengths, 0, 0) : found.network ? vec4(0) : found.x;
    if (slot < TABLES) ids[slot * p.edges + edge] = (found.columns - form - head.y) / head.z;
  }
}
