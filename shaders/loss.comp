// loss.comp: how far a pair is from its true pose, and how its key points spread, a work group per pair; see
// src/ops/loss.hpp.
// in  0 estimate f32[B,E]    official: 16 as in src/ops/pose.hpp; else 21 as in src/ops/head.hpp, E = 24
// in  1 truth    f32[B,20]   as in src/ops/loss.hpp
// in  2 keys     f32[2B·K,4] xyz; sources', then references'
// out 3 terms    f32[B,4]    rotation, translation, spread, 0
// spec 0 WORKGROUP=128  1 KIND=1 | grid pairs | shared 0.5 KiB
// loops 2·K·⌈K/WORKGROUP⌉ + 7; for K ≤ 1024 ≤ 16391 < 65535 | error: see src/ops/loss.hpp | fp32
#version 450
#extension GL_GOOGLE_include_directive : require
#include "common/loss.glsl"
#include "common/parameters.glsl"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const uint KIND = 1;

const uint WORKGROUP = gl_WorkGroupSize.x;
const bool OFFICIAL = KIND == OFFICIAL_KIND;
const uint E4 = OFFICIAL ? 4 : 6;

layout(set = 0, binding = 0) readonly buffer Estimate { vec4 estimate[]; };
layout(set = 0, binding = 1) readonly buffer TruthRows { vec4 truth[]; };
layout(set = 0, binding = 2) readonly buffer Keys { vec4 keys[]; };
layout(set = 0, binding = 3) writeonly buffer Terms { vec4 terms[]; };
layout(push_constant) uniform Push { KeyParameters p; };

shared float spread[WORKGROUP];

void main() {
  const uint lane = gl_LocalInvocationID.x, pair = p.first + gl_WorkGroupID.x;

  float sum = 0.0;
  for (uint i = lane; i < 2 * p.keys; i += WORKGROUP) {
    const uint first = (i < p.keys ? pair : pair + p.pairs) * p.keys;
    const vec3 own = keys[first + i % p.keys].xyz;
    float reach = 0.0;
    for (uint k = 0; k < p.keys; ++k) {
      const vec3 apart = abs(own - keys[first + k].xyz);
      reach += min(apart.x + apart.y + apart.z, SPREAD_REACH);
    }
    sum += reach;
  }
  spread[lane] = sum;
  for (uint reach = WORKGROUP / 2; reach > 0; reach /= 2) {
    barrier();
    if (lane < reach) spread[lane] += spread[lane + reach];
  }
  if (lane != 0) return;

  const vec4 e0 = estimate[pair * E4], e1 = estimate[pair * E4 + 1], e2 = estimate[pair * E4 + 2];
  const vec4 e3 = estimate[pair * E4 + 3];
  // Columns are rows of the estimate's matrix: of R, or of r, which is stored transposed.
  const mat3 rows = mat3(e0.xyz, vec3(e0.w, e1.xy), vec3(e1.zw, e2.x));
  const Truth t = truth_of(truth[pair * 5], truth[pair * 5 + 1], truth[pair * 5 + 2], truth[pair * 5 + 3],
                           truth[pair * 5 + 4], OFFICIAL ? transpose(rows) : rows);
  float rotation, translation;
  if (OFFICIAL) {
    rotation = square(t.R * rows - mat3(1)) / 9.0;
    const vec3 off = t.t - e2.yzw;
    translation = dot(off, off) / 3.0;
  } else {
    const vec4 e4 = estimate[pair * E4 + 4], e5 = estimate[pair * E4 + 5];
    const mat3 error = rows / max(sqrt(square(rows)), MATRIX_NORM_FLOOR) - INVERSE_SQRT3 * t.R;
    rotation = KIND == ROBUST_KIND ? ROBUST_ROTATION_WEIGHT * sqrt(square(error) + ROBUST_SOFTENING)
                                   : DIRECT_ROTATION_WEIGHT / 9.0 * square(error);
    const vec3 first = e2.yzw + vec3(e3.w, e4.xy), second = e3.xyz + vec3(e4.zw, e5.x);
    const vec3 off = second - t.R * first - t.t;
    translation = sqrt(dot(off, off) + DIRECT_SOFTENING);
  }
  const float share = -SPREAD_WEIGHT / (float(p.keys) * float(p.keys));
  terms[pair] = vec4(rotation, translation, share * spread[0], 0);
}
