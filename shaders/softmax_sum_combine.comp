// softmax_sum_combine.comp: joins what softmax_sum.comp made of a cloud's chunks: a work group per cloud and
// four columns of a channel. The order depends on nothing but the cloud's own number of rows.
// in  0 partials f32[P/128+S,PARTS,CHANNELS,⌈COLUMNS/4⌉,8]  as in softmax_sum.comp
// in  1 offsets  u32[S+1]             cloud s owns rows offsets[s] .. offsets[s+1]
// out 2 result   f32[S·CHANNELS,C4]   COLUMNS sums, padded to C4, a multiple of 4
// spec 0 WORKGROUP=32  1 CHANNELS  2 COLUMNS  3 PARTS≤16 | grid CHANNELS·⌈COLUMNS/4⌉ × clouds | shared 1 KiB
// loops PARTS·⌈rows/128⌉/WORKGROUP + 5; with ≤ 4 Mi rows of a cloud ≤ 16389 < 65535
// | error: see src/ops/softmax_sum.hpp | fp32
#version 450
#extension GL_GOOGLE_include_directive : require
#include "common/parameters.glsl"
#include "common/softmax_partial.glsl"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const uint CHANNELS = 32;
layout(constant_id = 2) const uint COLUMNS = 3;
layout(constant_id = 3) const uint PARTS = 1;

const uint WORKGROUP = gl_WorkGroupSize.x;
const uint VECTORS = (COLUMNS + 3) / 4;
const uint ITEMS = CHANNELS * VECTORS;

layout(set = 0, binding = 0) readonly buffer Partials { Partial partials[]; };
layout(set = 0, binding = 1) readonly buffer Offsets { uint offsets[]; };
layout(set = 0, binding = 2) writeonly buffer Result { vec4 result[]; };
layout(push_constant) uniform Push { SegmentParameters p; };

shared Partial joined[WORKGROUP];

void main() {
  const uint cloud = p.first + gl_WorkGroupID.y, lane = gl_LocalInvocationID.x;
  const uint begin = offsets[cloud], end = offsets[cloud + 1];
  const uint first = (begin / 128 + cloud) * PARTS * ITEMS + gl_WorkGroupID.x;
  const uint count = (end - begin + 127) / 128 * PARTS;

  Partial sum = no_rows();
  for (uint i = lane; i < count; i += WORKGROUP) sum = join(sum, partials[first + i * ITEMS]);
  joined[lane] = sum;
  for (uint reach = WORKGROUP / 2; reach > 0; reach /= 2) {
    barrier();
    if (lane < reach) joined[lane] = join(joined[lane], joined[lane + reach]);
  }
  if (lane == 0) result[cloud * ITEMS + gl_WorkGroupID.x] = joined[0].sums / joined[0].total;
}
