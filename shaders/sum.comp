// sum.comp: of up to six tensors of one shape, in the order given; see src/ops/sum.hpp. All are bound from the first
// item on.
// in  0 a   f32[N,4]
// in  1 b   f32[N,4]  this and those behind it only if COUNT says so
// in  2 c   f32[N,4]
// in  3 d   f32[N,4]
// in  4 e   f32[N,4]
// in  5 f   f32[N,4]
// mod 6 sum f32[N,4]  with MORE, what the others are added to
// spec 0 WORKGROUP=32  1 COUNT≤6  2 MORE | grid ceil(N / WORKGROUP) | shared 0 KiB
// loops none | error: see src/ops/sum.hpp | fp32
#version 450
#extension GL_GOOGLE_include_directive : require
#include "common/parameters.glsl"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const uint COUNT = 2;
layout(constant_id = 2) const bool MORE = false;

layout(set = 0, binding = 0) readonly buffer A { vec4 a[]; };
layout(set = 0, binding = 1) readonly buffer B { vec4 b[]; };
layout(set = 0, binding = 2) readonly buffer C { vec4 c[]; };
layout(set = 0, binding = 3) readonly buffer D { vec4 d[]; };
layout(set = 0, binding = 4) readonly buffer E { vec4 e[]; };
layout(set = 0, binding = 5) readonly buffer F { vec4 f[]; };
layout(set = 0, binding = 6) buffer Sum { vec4 sum[]; };
layout(push_constant) uniform Push { ItemParameters p; };

void main() {
  const uint i = gl_GlobalInvocationID.x;
  if (i >= p.items) return;
  vec4 x = MORE ? sum[i] + a[i] : a[i];
  if (COUNT > 1) x += b[i];
  if (COUNT > 2) x += c[i];
  if (COUNT > 3) x += d[i];
  if (COUNT > 4) x += e[i];
  if (COUNT > 5) x += f[i];
  sum[i] = x;
}
