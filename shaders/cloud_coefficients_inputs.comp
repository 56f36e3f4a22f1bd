// cloud_coefficients_inputs.comp: from the gradients of what clouds' features are extended by to those of the clouds'
// means and globals, which their partners' features have as well, a work group per cloud.
// in  0 d_numbers f32[S,E]   of cloud_coefficients_gradient.comp: globals, the partner's, scalar means, the partner's,
//                            vector means
// out 1 d_means   f32[S,M4]  C0 scalars, C1 vectors; padded to M4; if FLAGS & 1
// out 2 d_globals f32[S,G4]  GLOBALS scalars; padded to G4; if FLAGS & 2
// spec 0 WORKGROUP=32  1 C0  2 C1  3 GLOBALS  4 FLAGS≤3 | grid clouds | shared 0 KiB
// loops ≤ (M4 + G4)/WORKGROUP ≤ 4096 < 65535 | error: see src/ops/gradient.hpp | fp32
#version 450
#extension GL_GOOGLE_include_directive : require
#include "common/parameters.glsl"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const uint C0 = 4;
layout(constant_id = 2) const uint C1 = 4;
layout(constant_id = 3) const uint GLOBALS = 4;
layout(constant_id = 4) const uint FLAGS = 3;

const uint WORKGROUP = gl_WorkGroupSize.x;
const uint EXTRA = 2 * GLOBALS + 2 * C0;
const uint NUMBERS = EXTRA + 3 * C1;
const uint M4 = (C0 + 3 * C1 + 3) / 4 * 4;
const uint G4 = (GLOBALS + 3) / 4 * 4;

layout(set = 0, binding = 0) readonly buffer NumberGradient { float d_numbers[]; };
layout(set = 0, binding = 1) writeonly buffer MeanGradient { float d_means[]; };
layout(set = 0, binding = 2) writeonly buffer GlobalGradient { float d_globals[]; };
layout(push_constant) uniform Push { SegmentParameters p; };

void main() {
  const uint cloud = p.first + gl_WorkGroupID.x, half_clouds = p.segments / 2;
  const uint other = cloud < half_clouds ? cloud + half_clouds : cloud - half_clouds;
  const uint own = cloud * NUMBERS, partner = other * NUMBERS;
  if ((FLAGS & 1u) != 0u)
    for (uint i = gl_LocalInvocationID.x; i < M4; i += WORKGROUP) {
      float x = 0.0;
      if (i < C0)
        x = d_numbers[own + 2 * GLOBALS + i] + d_numbers[partner + 2 * GLOBALS + C0 + i];
      else if (i < C0 + 3 * C1)
        x = d_numbers[own + EXTRA + i - C0];
      d_means[cloud * M4 + i] = x;
    }
  if ((FLAGS & 2u) != 0u)
    for (uint i = gl_LocalInvocationID.x; i < G4; i += WORKGROUP)
      d_globals[cloud * G4 + i] = i < GLOBALS ? d_numbers[own + i] + d_numbers[partner + GLOBALS + i] : 0.0;
}
