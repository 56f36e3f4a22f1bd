// loss_gradient.comp: of the mean over pairs of the loss's terms, with respect to the estimate and to the key points,
// a work group per cloud; the source's does the pair's estimate. See src/ops/loss.hpp.
// in  0 estimate   f32[B,E]    official: 16 as in src/ops/pose.hpp; else 21 as in src/ops/head.hpp, E = 24
// in  1 truth      f32[B,20]   as in src/ops/loss.hpp
// in  2 keys       f32[2B·K,4] xyz; sources', then references'
// out 3 d_estimate f32[B,E]    if ESTIMATE
// out 4 d_keys     f32[2B·K,4] if KEYS
// spec 0 WORKGROUP=32  1 KIND=1  2 ESTIMATE  3 KEYS | grid clouds | shared 0 KiB
// loops K·⌈K/WORKGROUP⌉ + ⌈K/WORKGROUP⌉; for K ≤ 1024 ≤ 32800 < 65535 | error: see src/ops/gradient.hpp | fp32
#version 450
#extension GL_GOOGLE_include_directive : require
#include "common/loss.glsl"
#include "common/parameters.glsl"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const uint KIND = 1;
layout(constant_id = 2) const bool ESTIMATE = true;
layout(constant_id = 3) const bool KEYS = true;

const uint WORKGROUP = gl_WorkGroupSize.x;
const bool OFFICIAL = KIND == OFFICIAL_KIND;
const uint E4 = OFFICIAL ? 4 : 6;

layout(set = 0, binding = 0) readonly buffer Estimate { vec4 estimate[]; };
layout(set = 0, binding = 1) readonly buffer TruthRows { vec4 truth[]; };
layout(set = 0, binding = 2) readonly buffer Keys { vec4 keys[]; };
layout(set = 0, binding = 3) writeonly buffer EstimateGradient { vec4 d_estimate[]; };
layout(set = 0, binding = 4) writeonly buffer KeyGradient { vec4 d_keys[]; };
layout(push_constant) uniform Push { KeyParameters p; };

void estimate_gradient(uint pair) {
  const vec4 e0 = estimate[pair * E4], e1 = estimate[pair * E4 + 1], e2 = estimate[pair * E4 + 2];
  const vec4 e3 = estimate[pair * E4 + 3];
  // Columns are rows of the estimate's matrix: of R, or of r, which is stored transposed.
  const mat3 rows = mat3(e0.xyz, vec3(e0.w, e1.xy), vec3(e1.zw, e2.x));
  const Truth t = truth_of(truth[pair * 5], truth[pair * 5 + 1], truth[pair * 5 + 2], truth[pair * 5 + 3],
                           truth[pair * 5 + 4], OFFICIAL ? transpose(rows) : rows);
  const float share = 1.0 / float(p.pairs);
  // Columns of `along` are rows of the estimate's matrix.
  mat3 along;
  vec3 first, second;
  if (OFFICIAL) {
    along = share * 2.0 / 9.0 * (transpose(t.R) * (t.R * rows - mat3(1)));
    first = -share * 2.0 / 3.0 * (t.t - e2.yzw);
    second = vec3(0);
  } else {
    const vec4 e4 = estimate[pair * E4 + 4], e5 = estimate[pair * E4 + 5];
    const float length = sqrt(square(rows)), norm = max(length, MATRIX_NORM_FLOOR);
    const mat3 unit = rows / norm;
    const mat3 error = unit - INVERSE_SQRT3 * t.R;
    const float slope = KIND == ROBUST_KIND
                            ? ROBUST_ROTATION_WEIGHT / sqrt(square(error) + ROBUST_SOFTENING)
                            : 2.0 * DIRECT_ROTATION_WEIGHT / 9.0;
    along = share * slope * error;
    if (length >= MATRIX_NORM_FLOOR)
      along -= (dot(along[0], unit[0]) + dot(along[1], unit[1]) + dot(along[2], unit[2])) * unit;
    along /= norm;
    const vec3 off = e3.xyz + vec3(e4.zw, e5.x) - t.R * (e2.yzw + vec3(e3.w, e4.xy)) - t.t;
    second = share * off / sqrt(dot(off, off) + DIRECT_SOFTENING);
    first = -(transpose(t.R) * second);
  }
  d_estimate[pair * E4] = vec4(along[0], along[1].x);
  d_estimate[pair * E4 + 1] = vec4(along[1].yz, along[2].xy);
  d_estimate[pair * E4 + 2] = vec4(along[2].z, first);
  d_estimate[pair * E4 + 3] = OFFICIAL ? vec4(0) : vec4(second, first.x);
  if (!OFFICIAL) {
    d_estimate[pair * E4 + 4] = vec4(first.yz, second.xy);
    d_estimate[pair * E4 + 5] = vec4(second.z, 0, 0, 0);
  }
}

void main() {
  const uint lane = gl_LocalInvocationID.x, cloud = p.first + gl_WorkGroupID.x;
  if (ESTIMATE && lane == 0 && cloud < p.pairs) estimate_gradient(cloud);
  if (KEYS) {
    const uint first = cloud * p.keys;
    // Every pair of key points counts twice.
    const float share = -2.0 * SPREAD_WEIGHT / (float(p.keys) * float(p.keys) * float(p.pairs));
    for (uint i = lane; i < p.keys; i += WORKGROUP) {
      const vec3 own = keys[first + i].xyz;
      vec3 sum = vec3(0);
      for (uint k = 0; k < p.keys; ++k) {
        const vec3 apart = own - keys[first + k].xyz, size = abs(apart);
        if (!(size.x + size.y + size.z > SPREAD_REACH)) sum += sign(apart);
      }
      d_keys[first + i] = vec4(share * sum, 0);
    }
  }
}
