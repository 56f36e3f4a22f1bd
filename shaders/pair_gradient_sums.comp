// pair_gradient_sums.comp: the gradient of a radial table's columns, sector by sector, summed over edges; a work group per
// sector and four vec4s of coefficients, whose invocations take every so many edges of the sector, in their order.
// in  0 begins  u32[TABLES,SECTORS+1] of a sector's edges in its table's list
// in  1 lists   u32[TABLES,E]
// in  2 factors f32[TABLES+1,E,4]     of the columns
// in  3 d_coefficients f32[D,E,4]     frequency, channels in, channels out
// con 4 tables  u32[TABLES,8]         first number in the result, sectors, numbers of a sector, columns; coefficients,
//                                     channels in, channels out, vec4 in d_coefficients[]
// mod 5 result  f32[R]                ops/constants.hpp
// spec 0 WORKGROUP=32  1 SECTORS  2 TABLES  3 IN4
// grid (most sectors of a table, Σ over tables of ceil(vec4s / 4)) | shared 8 KiB
// loops ≤ TABLES + ⌈E / WORKGROUP⌉ + 64 / WORKGROUP + 64 < 65535 | error: see src/ops/gradient.hpp | fp32
#version 450
#extension GL_EXT_control_flow_attributes : require
#extension GL_GOOGLE_include_directive : require
#include "common/parameters.glsl"
#include "common/texels.glsl"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const uint SECTORS = 64;
layout(constant_id = 2) const uint TABLES = 20;
layout(constant_id = 3) const uint IN4 = 1;
layout(set = 0, binding = 0) readonly buffer Begins { uint begins[]; };
layout(set = 0, binding = 1) readonly buffer Lists { uint lists[]; };
READ_VEC4S(2, Factors);
READ_VEC4S(3, D_coefficients);
layout(set = 0, binding = 4) uniform Tables { uvec4 tables[2 * TABLES]; };
layout(set = 0, binding = 5) buffer Result { float result[]; };
layout(push_constant) uniform Push { PairGradientParameters p; };

const uint LANES = gl_WorkGroupSize.x, QUADS = 4, NUMBERS = 16 * QUADS;
shared float partial[NUMBERS * LANES];

uint quads_of(uint table) {
  const uvec4 more = tables[2u * table + 1u];
  return more.x / more.y * IN4;
}
uint units_of(uint table) { return (quads_of(table) + QUADS - 1u) / QUADS; }

void main() {
  const uint lane = gl_LocalInvocationID.x, sector = gl_WorkGroupID.x;
  uint table = 0u, unit = gl_WorkGroupID.y;
  while (unit >= units_of(table)) {
    unit -= units_of(table);
    ++table;
  }
  const uvec4 sizes = tables[2u * table], more = tables[2u * table + 1u];
  if (sector >= sizes.y) return;
  const uint at = table * (SECTORS + 1u) + sector, begin = begins[at], end = begins[at + 1u];
  const uint quads = quads_of(table), first = unit * QUADS;
  vec4 sum[QUADS][4];
  [[unroll]] for (int q = 0; q < QUADS; ++q)
    [[unroll]] for (int k = 0; k < 4; ++k) sum[q][k] = vec4(0);
  const uint rounds = (end - begin + LANES - 1u) / LANES;
  for (uint r = 0u; r < rounds; ++r) {
    const uint i = begin + r * LANES + lane, edge = lists[table * p.edges + min(i, end - 1u)];
    const vec4 x = i < end ? VEC4_OF(Factors, table * p.edges + edge) : vec4(0);
    [[unroll]] for (uint q = 0; q < QUADS; ++q) {
      const vec4 d = VEC4_OF(D_coefficients, (more.w + min(first + q, quads - 1u)) * p.edges + edge);
      [[unroll]] for (int k = 0; k < 4; ++k) sum[q][k] += x[k] * d;
    }
  }
  [[unroll]] for (int q = 0; q < QUADS; ++q)
    [[unroll]] for (int k = 0; k < 4; ++k)
      [[unroll]] for (int i = 0; i < 4; ++i) partial[((4 * q + k) * 4 + i) * LANES + lane] = sum[q][k][i];
  barrier();
  for (uint n = lane; n < NUMBERS; n += LANES) {
    float total = 0.0;
    for (uint l = 0u; l < LANES; ++l) total += partial[n * LANES + l];
    const uint quad = first + n / 16u, k = n / 4u % 4u, row = quad / (IN4 * more.z);
    const uint c = 4u * (quad / more.z % IN4) + n % 4u, o = quad % more.z;
    if (quad >= quads || k >= sizes.w || c >= more.y) continue;
    const uint place = sizes.x + sector * sizes.z + k * more.x + (row * more.z + o) * more.y + c;
    result[place] = total + (p.add > 0u ? result[place] : 0.0);
  }
}
