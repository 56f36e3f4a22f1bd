// cloud_coefficients.comp: the coefficients of a layer whose features are extended by numbers that are constant
// over a cloud, a work group per cloud; see src/ops/cloud_coefficients.hpp. Rows of the weights have
// Z = C0 + EXTRA + 1 columns: own scalars, appended scalars, one. With the cloud's numbers put in, the last two
// groups become one column.
// in  0 means        f32[S,M4]    C0 scalars, C1 vectors; padded to M4, a multiple of 4
// in  1 globals      f32[S,G4]    GLOBALS scalars; padded to G4
// in  2 weights      f32[W]       keys [HEADS,PATHS,Z]; keys at length zero [HEADS,Z,Z]; skip [OUT,Z]; values
//                                 at length zero [OUT,HEADS,Z]; values [OUT,HEADS,PATHS].
//                                 PATHS = C0 + 2·C1: of own scalars, own vectors, appended vectors
// out 3 coefficients f32[S,N4]    M₀, O₀, S₀, Mᶻ₀, Oᶻ₀ of src/ops/point_attention.hpp; padded to N4
// spec 0 WORKGROUP=128  1 C0  2 C1  3 GLOBALS  4 OUT  5 HEADS | grid clouds | shared 16 KiB
// loops as src/vk/cloud_coefficients.cpp counts them and sees to it, ≤ 65534 < 65535
// | error: see src/ops/cloud_coefficients.hpp | fp32
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
#include "common/cloud_layer.glsl"

layout(set = 0, binding = 0) readonly buffer Means { float means[]; };
layout(set = 0, binding = 1) readonly buffer Globals { float globals[]; };
layout(set = 0, binding = 2) readonly buffer Weights { float weights[]; };
layout(set = 0, binding = 3) writeonly buffer Coefficients { float coefficients[]; };
layout(push_constant) uniform Push { SegmentParameters p; };

const uint VECTORS = EXTRA;
const uint LAST = VECTORS + 3 * C1;
// appended scalars, appended vectors, last column of every row.
shared float numbers[4096];

float entry(uint row, uint column) {
  return column < C0 ? weights[row * Z + column] : numbers[LAST + row];
}

void main() {
  const uint cloud = p.first + gl_WorkGroupID.x, half_clouds = p.segments / 2;
  const uint other = cloud < half_clouds ? cloud + half_clouds : cloud - half_clouds;
  const uint lane = gl_LocalInvocationID.x, to = cloud * N4;

  for (uint i = lane; i < LAST; i += WORKGROUP)
    numbers[i] = i < GLOBALS            ? globals[cloud * G4 + i]
                 : i < 2 * GLOBALS      ? globals[other * G4 + i - GLOBALS]
                 : i < 2 * GLOBALS + C0 ? means[cloud * M4 + i - 2 * GLOBALS]
                 : i < EXTRA            ? means[other * M4 + i - 2 * GLOBALS - C0]
                                        : means[cloud * M4 + C0 + i - EXTRA];
  barrier();
  for (uint row = lane; row < ROWS; row += WORKGROUP) {
    float sum = 0.0;
    for (uint e = 0; e < EXTRA; ++e) sum += numbers[e] * weights[row * Z + C0 + e];
    numbers[LAST + row] = sum + weights[row * Z + C0 + EXTRA];
  }
  barrier();

  for (uint i = lane; i < O0 - M0; i += WORKGROUP) {
    const uint head = i / (LAYER_PATHS * FROM), path = i / FROM % LAYER_PATHS, column = i % FROM;
    float value = 0.0;
    if (path < OWN)
      value = entry(head * PATHS + path, column);
    else
      for (uint c = 0; c < C1; ++c)
        value += numbers[VECTORS + 3 * c + path - OWN] * entry(head * PATHS + OWN + c, column);
    coefficients[to + M0 + i] = value;
  }
  for (uint i = lane; i < S0 - O0; i += WORKGROUP) {
    const uint at = VALUES + i / LAYER_PATHS * PATHS, path = i % LAYER_PATHS;
    float value = 0.0;
    if (path < OWN)
      value = weights[at + path];
    else
      for (uint c = 0; c < C1; ++c) value += numbers[VECTORS + 3 * c + path - OWN] * weights[at + OWN + c];
    coefficients[to + O0 + i] = value;
  }
  for (uint i = lane; i < MZ0 - S0; i += WORKGROUP)
    coefficients[to + S0 + i] = entry(SKIP + i / FROM, i % FROM);
  for (uint i = lane; i < OZ0 - MZ0; i += WORKGROUP) {
    const uint row = ZERO_KEYS + i / (FROM * FROM) * Z, path = i / FROM % FROM, column = i % FROM;
    float value = 0.0;
    if (path == C0)
      for (uint e = 0; e < EXTRA; ++e) value += numbers[e] * entry(row + C0 + e, column);
    coefficients[to + MZ0 + i] = value + entry(path == C0 ? row + C0 + EXTRA : row + path, column);
  }
  for (uint i = lane; i < N - OZ0; i += WORKGROUP)
    coefficients[to + OZ0 + i] = entry(ZERO_VALUES + i / FROM, i % FROM);
}
