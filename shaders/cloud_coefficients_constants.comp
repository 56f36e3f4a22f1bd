// cloud_coefficients_constants.comp: the gradient of the constants of the layer on the extended features, over all
// clouds, compensated, an invocation per constant.
// in  0 codes          u32[C,2]   what a constant is: kind << 16 | column, row. Kinds: 0 no part of it; 1 of a row of the
//                                 weights; 2 the same, negated; 3 of a path (column) of the values; 4 of an appended
//                                 scalar's (column) values: skip minus values at length zero
// in  1 numbers        f32[S,E]   of cloud_coefficients_gradient.comp
// in  2 d_coefficients f32[S,N4]
// out 3 d_constants    f32[C]
// spec 0 WORKGROUP=32  1 C0  2 C1  3 GLOBALS  4 OUT  5 HEADS | grid ceil(C / WORKGROUP) | shared 0 KiB
// loops 4·S, S ≤ 16383: ≤ 65532 < 65535 | error: see src/ops/gradient.hpp | fp32
#version 450
#extension GL_GOOGLE_include_directive : require
#include "common/parameters.glsl"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const uint C0 = 4;
layout(constant_id = 2) const uint C1 = 4;
layout(constant_id = 3) const uint GLOBALS = 4;
layout(constant_id = 4) const uint OUT = 32;
layout(constant_id = 5) const uint HEADS = 2;

layout(set = 0, binding = 0) readonly buffer Codes { uvec2 codes[]; };
layout(set = 0, binding = 1) readonly buffer Numbers { float numbers[]; };
layout(set = 0, binding = 2) readonly buffer CoefficientGradient { float d_coefficients[]; };
layout(set = 0, binding = 3) writeonly buffer ConstantGradient { float d_constants[]; };
layout(push_constant) uniform Push { RowSumParameters p; };

#define NUMBER(cloud, i) numbers[(cloud) * NUMBERS + (i)]
#include "common/cloud_layer.glsl"
#include "common/cloud_layer_gradient.glsl"

float part(uint cloud, uint kind, uint row, uint column) {
  if (kind == 0u) return 0.0;
  if (kind == 3u) return value_gradient(cloud, row, column);
  if (kind == 4u)
    return NUMBER(cloud, column) * (d_coefficients[cloud * N4 + S0 + row / HEADS * FROM + C0] -
                                    d_coefficients[cloud * N4 + OZ0 + row * FROM + C0]);
  const float scale = column >= C0 && column < C0 + EXTRA ? NUMBER(cloud, column - C0) : 1.0;
  const float x = scale * row_gradient(cloud, row, min(column, C0));
  return kind == 1u ? x : -x;
}

void main() {
  const uint i = gl_GlobalInvocationID.x;
  if (i >= p.vectors * 4u) return;
  const uvec2 code = codes[i];
  precise float total = 0.0, lost = 0.0;
  for (uint cloud = 0; cloud < p.rows; ++cloud) {
    precise float next = part(cloud, code.x >> 16, code.y, code.x & 0xffffu) - lost;
    precise float grown = total + next;
    lost = (grown - total) - next;
    total = grown;
  }
  d_constants[i] = total;
}
