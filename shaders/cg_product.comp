// cg_product.comp: Clebsch–Gordan products of features, channel by channel, an invocation per number of the result; see
// src/ops/cg_product.hpp.
// in  0 a      f32[P,A]             CHANNELS × DIM_A numbers, padded to A, a multiple of 4
// in  1 b      f32[Q,E,B]           CHANNELS (1 if SHARED) × DIM_B, padded to B; E = max(K, 1)
// in  2 index  u32[Q,K]             rows of a; with K = 0 row n of a goes with row n of b
// in  3 terms  u32[DIM_OUT,TERMS,2] i + 65536 · j, then the coefficient; filled up with zero coefficients
// out 4 result f32[Q,E,R]           CHANNELS × DIM_OUT, padded to R
// spec 0 WORKGROUP=64  1 K≤64  2 CHANNELS  3 SHARED  4 DIM_A≤25  5 DIM_B≤25  6 DIM_OUT≤25  7 TERMS≤36 |
// grid ceil(Q·E·R / WORKGROUP), by x and y | shared 0 KiB
// loops ≤ TERMS ≤ 36 | error: see src/ops/cg_product.hpp | fp32
#version 450
#extension GL_GOOGLE_include_directive : require
#include "common/parameters.glsl"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const uint K = 0;
layout(constant_id = 2) const uint CHANNELS = 1;
layout(constant_id = 3) const bool SHARED = false;
layout(constant_id = 4) const uint DIM_A = 3;
layout(constant_id = 5) const uint DIM_B = 3;
layout(constant_id = 6) const uint DIM_OUT = 3;
layout(constant_id = 7) const uint TERMS = 2;

const uint A = (CHANNELS * DIM_A + 3) / 4 * 4;
const uint B = ((SHARED ? 1 : CHANNELS) * DIM_B + 3) / 4 * 4;
const uint WIDTH = CHANNELS * DIM_OUT;
const uint R = (WIDTH + 3) / 4 * 4;
const uint E = K > 0 ? K : 1;

layout(set = 0, binding = 0) readonly buffer Left { float a[]; };
layout(set = 0, binding = 1) readonly buffer Right { float b[]; };
layout(set = 0, binding = 2) readonly buffer Index { uint index[]; };
layout(set = 0, binding = 3) readonly buffer Terms { uvec2 terms[]; };
layout(set = 0, binding = 4) writeonly buffer Result { float result[]; };
layout(push_constant) uniform Push { RowParameters p; };

void main() {
  const uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
  const uint item = group * gl_WorkGroupSize.x + gl_LocalInvocationID.x;
  const uint edge = item / R, column = item % R;
  if (edge >= p.rows * E) return;

  float sum = 0.0;
  if (column < WIDTH) {
    const uint channel = column / DIM_OUT, first = column % DIM_OUT * TERMS;
    const uint left = (K > 0 ? index[edge] : edge) * A + channel * DIM_A;
    const uint right = edge * B + (SHARED ? 0 : channel * DIM_B);
    for (uint t = 0; t < TERMS; ++t) {
      const uvec2 term = terms[first + t];
      sum += uintBitsToFloat(term.y) * a[left + (term.x & 0xffffu)] * b[right + (term.x >> 16)];
    }
  }
  result[item] = sum;
}
