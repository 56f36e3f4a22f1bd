// pose.comp: the rotation nearest to a matrix, and the translation, an invocation per pair; see
// src/ops/pose.hpp. One-sided Jacobi: V turns the columns of A until they are orthogonal; then they are the
// left singular vectors, scaled. Both bases are kept right-handed, so U Vᵀ is a rotation and a reflection flips
// the smallest direction.
// in  0 pieces f32[B,24]  21 as in src/ops/head.hpp
// out 1 poses  f32[B,16]  R (9, row-major), t (3), singular values (3, descending), det U Vᵀ before the flip
// spec 0 WORKGROUP=32 | grid ceil(B / WORKGROUP) | shared 0 KiB
// loops ≤ 6 < 65535 | error: see src/ops/pose.hpp | fp32
#version 450
#extension GL_GOOGLE_include_directive : require
#include "common/parameters.glsl"

layout(local_size_x_id = 0) in;

const float NORM_FLOOR = 1e-5;

layout(set = 0, binding = 0) readonly buffer Pieces { vec4 pieces[]; };
layout(set = 0, binding = 1) writeonly buffer Poses { vec4 poses[]; };
layout(push_constant) uniform Push { SegmentParameters p; };

bool finite(vec4 x) {
  const uvec4 exponent = floatBitsToUint(x) & 0x7f800000u;
  return all(notEqual(exponent, uvec4(0x7f800000u)));
}

float largest(vec3 x) { return max(max(abs(x.x), abs(x.y)), abs(x.z)); }

// The unit vector along x, of whatever length; zero stays.
vec3 direction(vec3 x) {
  const float size = largest(x);
  const vec3 scaled = x / (size > 0.0 ? size : 1.0);
  return size > 0.0 ? scaled * inversesqrt(dot(scaled, scaled)) : vec3(0);
}

vec3 perpendicular(vec3 x) {
  const vec3 a = abs(x);
  const vec3 axis = a.x <= a.y && a.x <= a.z ? vec3(1, 0, 0) : a.y <= a.z ? vec3(0, 1, 0) : vec3(0, 0, 1);
  return normalize(cross(x, axis));
}

// Rotates the columns p and q of A and V until A's are orthogonal.
void rotate(inout vec3 ap, inout vec3 aq, inout vec3 vp, inout vec3 vq) {
  const float product = dot(ap, aq);
  if (abs(product) < 1e-30) return;
  const float zeta = (dot(aq, aq) - dot(ap, ap)) / (2.0 * product);
  const float t = (zeta < 0.0 ? -1.0 : 1.0) / (abs(zeta) + sqrt(1.0 + zeta * zeta));
  const float c = inversesqrt(1.0 + t * t), s = c * t;
  const vec3 a = ap, v = vp;
  ap = c * a - s * aq;
  aq = s * a + c * aq;
  vp = c * v - s * vq;
  vq = s * v + c * vq;
}

// Exchanges two columns where the second is longer; V stays right-handed.
void sort(inout vec3 ap, inout vec3 aq, inout vec3 vp, inout vec3 vq) {
  if (dot(aq, aq) <= dot(ap, ap)) return;
  const vec3 a = ap, v = vp;
  ap = aq, aq = -a;
  vp = vq, vq = -v;
}

mat3 right_handed(mat3 v) {
  const vec3 x = normalize(v[0]), y = normalize(v[1] - dot(v[1], x) * x);
  return mat3(x, y, cross(x, y));
}

void main() {
  const uint pair = p.first + gl_GlobalInvocationID.x;
  if (pair >= p.segments) return;
  const vec4 p0 = pieces[pair * 6], p1 = pieces[pair * 6 + 1], p2 = pieces[pair * 6 + 2];
  const vec4 p3 = pieces[pair * 6 + 3], p4 = pieces[pair * 6 + 4], p5 = vec4(pieces[pair * 6 + 5].x, 0, 0, 0);
  if (!(finite(p0) && finite(p1) && finite(p2) && finite(p3) && finite(p4) && finite(p5))) {
    const vec4 nan = vec4(uintBitsToFloat(0x7fc00000u));
    poses[pair * 4] = nan, poses[pair * 4 + 1] = nan, poses[pair * 4 + 2] = nan, poses[pair * 4 + 3] = nan;
    return;
  }
  const vec3 mean1 = p2.yzw, mean2 = p3.xyz, shift1 = vec3(p3.w, p4.xy), shift2 = vec3(p4.zw, p5.x);

  // Scaled by a power of two to entries around 1. The pieces hold the transpose: their rows are A's columns.
  const vec3 row0 = p0.xyz, row1 = vec3(p0.w, p1.xy), row2 = vec3(p1.zw, p2.x);
  const uint exponent = floatBitsToUint(max(max(largest(row0), largest(row1)), largest(row2))) >> 23;
  const float scale = uintBitsToFloat((254 - min(exponent, 253)) << 23);
  const bool zero = exponent == 0;
  const mat3 A = zero ? mat3(1) : mat3(row0 * scale, row1 * scale, row2 * scale);
  const float norm = sqrt(dot(A[0], A[0]) + dot(A[1], A[1]) + dot(A[2], A[2]));

  mat3 V = mat3(1), turned = A;
  for (int sweep = 0; sweep < 6; ++sweep) {
    vec3 a0 = turned[0], a1 = turned[1], a2 = turned[2], v0 = V[0], v1 = V[1], v2 = V[2];
    rotate(a0, a1, v0, v1);
    rotate(a0, a2, v0, v2);
    rotate(a1, a2, v1, v2);
    sort(a0, a1, v0, v1);
    sort(a0, a2, v0, v2);
    sort(a1, a2, v1, v2);
    V = right_handed(mat3(v0, v1, v2));
    turned = A * V;
  }

  const vec3 u0 = direction(turned[0]);
  // Twice: what is left of a small column is mostly rounding.
  vec3 u1 = direction(turned[1] - dot(turned[1], u0) * u0);
  u1 -= dot(u1, u0) * u0;
  u1 = dot(u1, u1) < 0.25 ? perpendicular(u0) : normalize(u1);
  const vec3 u2 = cross(u0, u1);
  mat3 R = mat3(u0, u1, u2) * transpose(V);
  // One step of Newton's takes off most of what rounding left.
  R = R * (1.5 * mat3(1) - 0.5 * (transpose(R) * R));
  const vec3 t = mean2 + shift2 - R * (mean1 + shift1);
  const float s0 = length(turned[0]), s1 = length(turned[1]), s2 = length(turned[2]);
  const vec3 s = vec3(max(max(s0, s1), s2), max(min(s0, s1), min(max(s0, s1), s2)), min(min(s0, s1), s2));
  const float per_norm = zero ? 0.0 : 1.0 / max(norm, NORM_FLOOR * scale);

  poses[pair * 4] = vec4(R[0].x, R[1].x, R[2].x, R[0].y);
  poses[pair * 4 + 1] = vec4(R[1].y, R[2].y, R[0].z, R[1].z);
  poses[pair * 4 + 2] = vec4(R[2].z, t);
  poses[pair * 4 + 3] = vec4(s * per_norm, dot(turned[2], u2) < 0.0 ? -1.0 : 1.0);
}
