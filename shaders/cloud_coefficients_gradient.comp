// cloud_coefficients_gradient.comp: with respect to the numbers that a cloud's features are extended by, a work group
// per cloud; see src/ops/cloud_coefficients.hpp and cloud_coefficients.comp.
// in  0 means          f32[S,M4]   C0 scalars, C1 vectors; padded to M4, a multiple of 4
// in  1 globals        f32[S,G4]   GLOBALS scalars; padded to G4
// in  2 weights        f32[W]      as in cloud_coefficients.comp
// in  3 d_coefficients f32[S,N4]   M₀, O₀, S₀, Mᶻ₀, Oᶻ₀ of src/ops/point_attention.hpp; padded to N4
// out 4 numbers        f32[S,E]    appended scalars, appended vectors
// out 5 d_numbers      f32[S,E]
// spec 0 WORKGROUP=128  1 C0  2 C1  3 GLOBALS  4 OUT  5 HEADS | grid clouds | shared 16 KiB
// loops as src/vk/cloud_coefficients_gradient.cpp counts them and sees to it, ≤ 65534 < 65535
// | error: see src/ops/gradient.hpp | fp32
#version 450
#extension GL_GOOGLE_include_directive : require
#include "common/parameters.glsl"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const uint C0 = 4;
layout(constant_id = 2) const uint C1 = 4;
layout(constant_id = 3) const uint GLOBALS = 4;
layout(constant_id = 4) const uint OUT = 32;
layout(constant_id = 5) const uint HEADS = 2;

const uint WORKGROUP = gl_WorkGroupSize.x;

layout(set = 0, binding = 0) readonly buffer Means { float means[]; };
layout(set = 0, binding = 1) readonly buffer Globals { float globals[]; };
layout(set = 0, binding = 2) readonly buffer Weights { float weights[]; };
layout(set = 0, binding = 3) readonly buffer CoefficientGradient { float d_coefficients[]; };
layout(set = 0, binding = 4) writeonly buffer Numbers { float all_numbers[]; };
layout(set = 0, binding = 5) writeonly buffer NumberGradient { float d_numbers[]; };
layout(push_constant) uniform Push { SegmentParameters p; };

// The cloud's numbers; from LAST on the last column of every row of the condensed weights, from GRADIENT on its
// gradient.
shared float numbers[4096];
#define NUMBER(cloud, i) numbers[i]
#include "common/cloud_layer.glsl"
#include "common/cloud_layer_gradient.glsl"
const uint LAST = NUMBERS;
const uint GRADIENT = LAST + ROWS;

float entry(uint row, uint column) {
  return column < C0 ? weights[row * Z + column] : numbers[LAST + row];
}

void main() {
  const uint cloud = p.first + gl_WorkGroupID.x, half_clouds = p.segments / 2;
  const uint other = cloud < half_clouds ? cloud + half_clouds : cloud - half_clouds;
  const uint lane = gl_LocalInvocationID.x, from = cloud * N4;

  for (uint i = lane; i < NUMBERS; i += WORKGROUP) {
    const float x = i < GLOBALS            ? globals[cloud * G4 + i]
                    : i < 2 * GLOBALS      ? globals[other * G4 + i - GLOBALS]
                    : i < 2 * GLOBALS + C0 ? means[cloud * M4 + i - 2 * GLOBALS]
                    : i < EXTRA            ? means[other * M4 + i - 2 * GLOBALS - C0]
                                           : means[cloud * M4 + C0 + i - EXTRA];
    numbers[i] = x;
    all_numbers[cloud * NUMBERS + i] = x;
  }
  barrier();
  for (uint row = lane; row < ROWS; row += WORKGROUP) {
    float sum = weights[row * Z + C0 + EXTRA];
    for (uint e = 0; e < EXTRA; ++e) sum += numbers[e] * weights[row * Z + C0 + e];
    numbers[LAST + row] = sum;
    numbers[GRADIENT + row] = row_gradient(cloud, row, C0);
  }
  barrier();

  for (uint i = lane; i < NUMBERS; i += WORKGROUP) {
    float sum = 0.0;
    if (i < EXTRA) {
      for (uint row = 0; row < ROWS; ++row) sum += numbers[GRADIENT + row] * weights[row * Z + C0 + i];
      for (uint head = 0; head < HEADS; ++head)
        for (uint column = 0; column < FROM; ++column)
          sum += d_coefficients[from + MZ0 + (head * FROM + C0) * FROM + column] *
                 entry(ZERO_KEYS + head * Z + C0 + i, column);
    } else {
      const uint path = OWN + (i - VECTORS) / 3, layer_path = OWN + (i - VECTORS) % 3;
      for (uint head = 0; head < HEADS; ++head)
        for (uint column = 0; column < FROM; ++column)
          sum += d_coefficients[from + M0 + (head * LAYER_PATHS + layer_path) * FROM + column] *
                 entry(head * PATHS + path, column);
      for (uint row = 0; row < OUT * HEADS; ++row)
        sum += d_coefficients[from + O0 + row * LAYER_PATHS + layer_path] * weights[VALUES + row * PATHS + path];
    }
    d_numbers[cloud * NUMBERS + i] = sum;
  }
}
