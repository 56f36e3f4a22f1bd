// pair_gradient_sums.comp: the gradient of a radial table's columns, sector by sector, summed over edges in their order;
// an invocation per sector and eight coefficients.
// in  0 begins  u32[TABLES,SECTORS+1] of a sector's edges in its table's list
// in  1 lists   u32[TABLES,E]
// in  2 factors f32[TABLES+1,E,4]     of the columns
// in  3 d_coefficients f32[E,D,4]     frequency, channels in, channels out
// con 4 tables  u32[TABLES,8]         first number in the result, sectors, numbers of a sector, columns; coefficients,
//                                     channels in, channels out, vec4 in d_coefficients[]
// mod 5 result  f32[R]                ops/constants.hpp
// spec 0 WORKGROUP=32  1 SECTORS  2 TABLES  3 IN4  4 D
// grid (ceil(sectors · pairs of vec4s of a table / WORKGROUP), TABLES) | shared 0 KiB
// loops ≤ E < 65535 | error: with the rest 1e-4 of the largest entry | fp32
#version 450
#extension GL_EXT_control_flow_attributes : require
#extension GL_GOOGLE_include_directive : require
#include "common/parameters.glsl"
#include "common/texels.glsl"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const uint SECTORS = 64;
layout(constant_id = 2) const uint TABLES = 20;
layout(constant_id = 3) const uint IN4 = 1;
layout(constant_id = 4) const uint D = 144;
layout(set = 0, binding = 0) readonly buffer Begins { uint begins[]; };
layout(set = 0, binding = 1) readonly buffer Lists { uint lists[]; };
READ_VEC4S(2, Factors);
READ_VEC4S(3, D_coefficients);
layout(set = 0, binding = 4) uniform Tables { uvec4 tables[2 * TABLES]; };
layout(set = 0, binding = 5) buffer Result { float result[]; };
layout(push_constant) uniform Push { PairGradientParameters p; };

void main() {
  const uint number = gl_GlobalInvocationID.x, table = gl_WorkGroupID.y;
  const uvec4 sizes = tables[2u * table], more = tables[2u * table + 1u];
  const uint in_channels = more.y, out_channels = more.z, rows = more.x / (in_channels * out_channels);
  const uint quads = rows * IN4 * out_channels;
  const uint units = (quads + 1u) / 2u, sector = number / units, first = number % units * 2u;
  const bool inside = sector < sizes.y;
  const uint at = table * (SECTORS + 1u) + min(sector, SECTORS - 1u);
  const uint begin = begins[at], end = inside ? begins[at + 1u] : begin;
  const uint column = more.w + first, second = more.w + min(first + 1u, quads - 1u);
  vec4 sum[2][4];
  [[unroll]] for (int k = 0; k < 4; ++k) sum[0][k] = sum[1][k] = vec4(0);
  for (uint i = begin; i < end; ++i) {
    const uint edge = lists[table * p.edges + i];
    const vec4 x = VEC4_OF(Factors, table * p.edges + edge);
    const vec4 d0 = VEC4_OF(D_coefficients, edge * D + column), d1 = VEC4_OF(D_coefficients, edge * D + second);
    [[unroll]] for (int k = 0; k < 4; ++k) {
      sum[0][k] += x[k] * d0;
      sum[1][k] += x[k] * d1;
    }
  }
  [[unroll]] for (uint part = 0; part < 2; ++part) {
    const uint quad = first + part;
    const uint row = quad / (IN4 * out_channels), c = quad / out_channels % IN4, o = quad % out_channels;
    const uint to = sizes.x + sector * sizes.z + (row * out_channels + o) * in_channels + 4u * c;
    [[unroll]] for (int k = 0; k < 4; ++k)
      [[unroll]] for (int i = 0; i < 4; ++i)
        if (inside && quad < quads && k < sizes.w && 4u * c + i < in_channels) {
          const uint place = to + k * more.x + i;
          result[place] = sum[part][k][i] + (p.add > 0u ? result[place] : 0.0);
        }
  }
}
