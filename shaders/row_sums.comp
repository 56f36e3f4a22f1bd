// row_sums.comp: the sum of a matrix's rows, first to last, compensated: what each pair or cloud adds to the gradient
// of an operation's constants.
// in  0 rows f32[R,W]  W = 4·vectors
// out 1 sum  f32[W]
// spec 0 WORKGROUP=32 | grid ceil(W / 4 / WORKGROUP) | shared 0 KiB
// loops R ≤ 65534 < 65535 | error: 2e-7 of the largest addend times √R | fp32
#version 450
#extension GL_GOOGLE_include_directive : require
#include "common/parameters.glsl"

layout(local_size_x_id = 0) in;

layout(set = 0, binding = 0) readonly buffer Rows { vec4 rows[]; };
layout(set = 0, binding = 1) writeonly buffer Sum { vec4 sum[]; };
layout(push_constant) uniform Push { RowSumParameters p; };

void main() {
  const uint i = gl_GlobalInvocationID.x;
  if (i >= p.vectors) return;
  precise vec4 total = vec4(0), lost = vec4(0);
  for (uint r = 0; r < p.rows; ++r) {
    precise vec4 next = rows[r * p.vectors + i] - lost;
    precise vec4 grown = total + next;
    lost = (grown - total) - next;
    total = grown;
  }
  sum[i] = total;
}
