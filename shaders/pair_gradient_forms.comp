// pair_gradient_forms.comp: the gradients of the quadratic forms of a radial table, summed over edges in their order: of
// the second variance's, an invocation per sector; of the first one's, one more work group, each of its invocations every
// so many edges.
// in  0 begins   u32[TABLES,SECTORS+1] of a sector's edges in its table's list
// in  1 lists    u32[TABLES,E]
// in  2 factors  f32[TABLES+1,E,4]     of the columns; the lengths
// in  3 d_radial f32[TABLES,E,4]       the last two: gradients of the second and of the first variance
// con 4 heads    u32[TABLES,12]        common/pair_tables.glsl
// con 5 tables   u32[TABLES,8]         first number in the result, sectors, numbers of a sector, columns; coefficients
// mod 6 result   f32[R]                ops/constants.hpp
// spec 0 WORKGROUP=32  1 SECTORS  2 TABLES | grid (ceil(SECTORS / WORKGROUP) + 1, TABLES) | shared 0.5 KiB
// loops ≤ E < 65535 | error: see src/ops/gradient.hpp | fp32
#version 450
#extension GL_EXT_control_flow_attributes : require
#extension GL_GOOGLE_include_directive : require
#include "common/parameters.glsl"
#include "common/texels.glsl"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const uint SECTORS = 64;
layout(constant_id = 2) const uint TABLES = 20;
layout(set = 0, binding = 0) readonly buffer Begins { uint begins[]; };
layout(set = 0, binding = 1) readonly buffer Lists { uint lists[]; };
READ_VEC4S(2, Factors);
READ_VEC4S(3, D_radial);
layout(set = 0, binding = 4) uniform Heads { uvec4 heads[3 * TABLES]; };
layout(set = 0, binding = 5) uniform Tables { uvec4 tables[2 * TABLES]; };
layout(set = 0, binding = 6) buffer Result { float result[]; };
layout(push_constant) uniform Push { PairGradientParameters p; };

const uint SWAPPED = 1u, DEGREE1 = 2u;
const uint LANES = gl_WorkGroupSize.x;
shared vec3 partial[LANES];

void main() {
  const uint lane = gl_LocalInvocationID.x, table = gl_WorkGroupID.y;
  const bool first_form = gl_WorkGroupID.x == gl_NumWorkGroups.x - 1u;
  const uvec4 sizes = tables[2u * table], head = heads[3u * table];
  const uint number = gl_GlobalInvocationID.x, step = first_form ? LANES : 1u;
  const bool inside = (first_form || number < sizes.y) && (head.w & DEGREE1) == 0u;
  const uint at = table * (SECTORS + 1u) + min(number, SECTORS - 1u);
  const uint begin = first_form ? lane : begins[at], end = !inside ? begin : first_form ? p.edges : begins[at + 1u];
  float sum[6];
  [[unroll]] for (int i = 0; i < 6; ++i) sum[i] = 0.0;
  for (uint i = begin; i < end; i += step) {
    const uint edge = first_form ? i : lists[table * p.edges + i];
    const vec4 x = VEC4_OF(Factors, table * p.edges + edge);
    const vec2 lengths = VEC4_OF(Factors, TABLES * p.edges + edge).xy, d = VEC4_OF(D_radial, table * p.edges + edge).zw;
    const vec2 u = first_form ? ((head.w & SWAPPED) != 0u ? lengths.yx : lengths) : x.w > 0.0 ? x.xy / x.z : vec2(0);
    const float g = first_form ? d.y : d.x;
    sum[0] += g * u.x * u.x;
    sum[1] += g * u.x * u.y;
    sum[2] += g * u.y * u.y;
    sum[3] += g * u.x;
    sum[4] += g * u.y;
    sum[5] += g;
  }
  partial[lane] = vec3(sum[0], sum[1], sum[2]);
  barrier();
  if (first_form && lane > 0u) return;
  if (first_form) {
    for (uint i = 1u; i < LANES; ++i)
      [[unroll]] for (int k = 0; k < 3; ++k) sum[k] += partial[i][k];
  }
  const uint to = sizes.x + (first_form ? sizes.y * sizes.z : number * sizes.z + 4u * tables[2u * table + 1u].x);
  [[unroll]] for (int i = 0; i < 6; ++i)
    if (inside && (!first_form || i < 3)) result[to + i] = sum[i] + (p.add > 0u ? result[to + i] : 0.0);
}
