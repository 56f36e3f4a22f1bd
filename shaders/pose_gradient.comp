// pose_gradient.comp: of the rotation nearest to a matrix, and of the translation, with respect to the pieces they are
// made from, an invocation per pair; see src/ops/pose.hpp. With r̂ = R H, H symmetric, Rᵀ dR = [w]× and
// (tr H − H) w is the axial vector of Rᵀ dr̂ − dr̂ᵀ R: symmetric in 3×3, solved by its adjugate. Its eigenvalues are
// sums of two singular values, the last one negated where r̂ is nearer to a reflection. The norm of r counts as a
// constant: R does not depend on it.
// in  0 pieces   f32[B,24]  21 as in src/ops/head.hpp
// in  1 poses    f32[B,16]  as in src/ops/pose.hpp
// in  2 d_poses  f32[B,16]  of R and t; singular values and determinant have no gradient
// out 3 d_pieces f32[B,24]
// spec 0 WORKGROUP=32 | grid ceil(B / WORKGROUP) | shared 0 KiB
// loops ≤ 6 < 65535 | error: see src/ops/gradient.hpp | fp32
#version 450
#extension GL_GOOGLE_include_directive : require
#include "common/loss.glsl"
#include "common/parameters.glsl"

layout(local_size_x_id = 0) in;

const float SUM_FLOOR = 1e-6;  // the least sum of two singular values

layout(set = 0, binding = 0) readonly buffer Pieces { vec4 pieces[]; };
layout(set = 0, binding = 1) readonly buffer Poses { vec4 poses[]; };
layout(set = 0, binding = 2) readonly buffer PoseGradient { vec4 d_poses[]; };
layout(set = 0, binding = 3) writeonly buffer PieceGradient { vec4 d_pieces[]; };
layout(push_constant) uniform Push { SegmentParameters p; };

bool finite(vec4 x) {
  const uvec4 exponent = floatBitsToUint(x) & 0x7f800000u;
  return all(notEqual(exponent, uvec4(0x7f800000u)));
}

// The matrix of rows one after the other.
mat3 matrix_of(vec4 a, vec4 b, vec4 c) { return transpose(mat3(a.xyz, vec3(a.w, b.xy), vec3(b.zw, c.x))); }

// The axial vector of a matrix minus its transpose.
vec3 axial(mat3 m) { return vec3(m[1].z - m[2].y, m[2].x - m[0].z, m[0].y - m[1].x); }

void main() {
  const uint pair = p.first + gl_GlobalInvocationID.x;
  if (pair >= p.segments) return;
  const vec4 p0 = pieces[pair * 6], p1 = pieces[pair * 6 + 1], p2 = pieces[pair * 6 + 2];
  const vec4 p3 = pieces[pair * 6 + 3], p4 = pieces[pair * 6 + 4], p5 = vec4(pieces[pair * 6 + 5].x, 0, 0, 0);
  if (!(finite(p0) && finite(p1) && finite(p2) && finite(p3) && finite(p4) && finite(p5))) {
    const vec4 nan = vec4(uintBitsToFloat(0x7fc00000u));
    for (uint i = 0; i < 6; ++i) d_pieces[pair * 6 + i] = nan;
    return;
  }
  const mat3 R = matrix_of(poses[pair * 4], poses[pair * 4 + 1], poses[pair * 4 + 2]);
  const vec4 last = poses[pair * 4 + 3];
  const vec3 s = vec3(last.xy, last.w > 0.0 ? last.z : -last.z);

  // The pieces hold the transpose: their rows are r's columns.
  const mat3 r = mat3(p0.xyz, vec3(p0.w, p1.xy), vec3(p1.zw, p2.x));
  const float norm = max(sqrt(square(r)), MATRIX_NORM_FLOOR);
  const mat3 turned = transpose(R) * (r / norm), H = 0.5 * (turned + transpose(turned));
  const mat3 K = (H[0].x + H[1].y + H[2].z) * mat3(1) - H;
  const float determinant = max(s.x + s.y, SUM_FLOOR) * max(s.x + s.z, SUM_FLOOR) * max(s.y + s.z, SUM_FLOOR);

  const vec3 first = p2.yzw + vec3(p3.w, p4.xy);
  const vec4 g2 = d_poses[pair * 4 + 2];
  const vec3 translation = g2.yzw;
  const mat3 rotation =
      matrix_of(d_poses[pair * 4], d_poses[pair * 4 + 1], g2) - outerProduct(translation, first);
  const vec3 a = axial(transpose(R) * rotation);
  const vec3 w = vec3(dot(cross(K[1], K[2]), a), dot(cross(K[2], K[0]), a), dot(cross(K[0], K[1]), a)) / determinant;
  const mat3 d = R * mat3(0, w.z, -w.y, -w.z, 0, w.x, w.y, -w.x, 0) / norm;
  const vec3 shift = -(transpose(R) * translation);

  d_pieces[pair * 6] = vec4(d[0], d[1].x);
  d_pieces[pair * 6 + 1] = vec4(d[1].yz, d[2].xy);
  d_pieces[pair * 6 + 2] = vec4(d[2].z, shift);
  d_pieces[pair * 6 + 3] = vec4(translation, shift.x);
  d_pieces[pair * 6 + 4] = vec4(shift.yz, translation.xy);
  d_pieces[pair * 6 + 5] = vec4(translation.z, 0, 0, 0);
}
