// outer_sums.comp: sums over a tile's rows of outer products of vectors that their records hold, in blocks of 4×4; an
// invocation per block.
// in  0 record   f32[Q,4·RECORD] from first_row on
// in  1 tiles    u32[tiles,4]
// in  2 jobs     u32[jobs,4] first vec4 of the left and of the right vector; vec4s from one of its components to the
//                            next, left in the low half; components, and IF_FLAGGED
// out 3 partials f32[tiles,jobs,16] rows are the left vector's
// spec 0 WORKGROUP=32  1 RECORD  2 FLAG | grid (tiles, ceil(jobs / WORKGROUP)) | shared 0 KiB
// loops ≤ 32 + 33·9 < 65535 | error: see src/ops/gradient.hpp | fp32
#version 450
#extension GL_GOOGLE_include_directive : require
#include "common/parameters.glsl"
#include "common/texels.glsl"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const uint RECORD = 64;  // vec4s of a record
layout(constant_id = 2) const uint FLAG = 0;     // where a record has its flag
const uint IF_FLAGGED = 0x80000000u;             // only of tiles where one is not 0

READ_VEC4S(0, Record);
layout(set = 0, binding = 1) readonly buffer Tiles { uvec4 tiles[]; };
layout(set = 0, binding = 2) readonly buffer Jobs { uvec4 jobs[]; };
layout(set = 0, binding = 3) writeonly buffer Partials { vec4 partials[]; };
layout(push_constant) uniform Push { OuterParameters p; };

void main() {
  const uint number = gl_WorkGroupID.y * gl_WorkGroupSize.x + gl_LocalInvocationID.x;
  const uvec4 job = jobs[min(number, p.jobs - 1u)];
  const uint t = p.first_tile + gl_WorkGroupID.x;
  const uint first = (tiles[t].y - p.first_row) * RECORD;
  uint rows = tiles[t].z - tiles[t].y;
  if ((job.w & IF_FLAGGED) != 0u) {
    uint any = 0u;
    for (uint i = 0; i < rows; ++i) any |= floatBitsToUint(VEC4_OF(Record, first + i * RECORD + FLAG).x);
    rows = any == 0u ? 0u : rows;
  }
  const uint components = job.w & ~IF_FLAGGED;
  mat4 sum = mat4(0);
  for (uint a = 0; a < components; ++a) {
    uint at_left = first + job.x + a * (job.z & 0xffffu), at_right = first + job.y + a * (job.z >> 16);
    for (uint i = 0; i < rows; ++i) {
      const vec4 left = VEC4_OF(Record, at_left), right = VEC4_OF(Record, at_right);
      at_left += RECORD;
      at_right += RECORD;
      sum[0] += left.x * right;
      sum[1] += left.y * right;
      sum[2] += left.z * right;
      sum[3] += left.w * right;
    }
  }
  if (number < p.jobs) {
    const uint to = (t * p.jobs + number) * 4u;
    partials[to] = sum[0];
    partials[to + 1u] = sum[1];
    partials[to + 2u] = sum[2];
    partials[to + 3u] = sum[3];
  }
}
