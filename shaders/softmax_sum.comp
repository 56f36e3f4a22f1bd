// softmax_sum.comp: softmax over a chunk of 128 rows of a cloud, relative to its own largest logits, and the
// sums of values it weights; softmax_sum_combine.comp joins them. See src/ops/softmax_sum.hpp. An invocation
// takes four columns of a channel in every PARTS-th row of the chunk: a part. A chunk is four tiles; the first
// one's work group does it, the others have nothing to do.
// in  0 logits   f32[P,L]        the first CHANNELS columns are used; rows padded to L
// in  1 values   f32[P,V]        COLUMNS columns from SKIP on are summed; rows padded to V, a multiple of 4
// in  2 tiles    u32[tiles,4]    segment, first row, row past the last, tile within the segment
// in  3 offsets  u32[S+1]        cloud s owns rows offsets[s] .. offsets[s+1]
// out 4 partials f32[P/128+S,PARTS,CHANNELS,⌈COLUMNS/4⌉,8]  sums of 4 columns, largest logit, total weight,
//                                –, –; chunk c of cloud s is number offsets[s]/128 + s + c
// spec 0 WORKGROUP=32  1 CHANNELS  2 L  3 V  4 SKIP  5 COLUMNS  6 PARTS≤16 | grid tiles | shared 0 KiB
// loops 17 per WORKGROUP of CHANNELS·⌈COLUMNS/4⌉; with ≤ 65536 of those ≤ 34816 < 65535
// | error: see src/ops/softmax_sum.hpp | fp32
#version 450
#extension GL_EXT_control_flow_attributes : require
#extension GL_GOOGLE_include_directive : require
#include "common/parameters.glsl"
#include "common/softmax_partial.glsl"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const uint CHANNELS = 32;
layout(constant_id = 2) const uint L = 32;
layout(constant_id = 3) const uint V = 4;
layout(constant_id = 4) const uint SKIP = 0;
layout(constant_id = 5) const uint COLUMNS = 3;
layout(constant_id = 6) const uint PARTS = 1;

const uint WORKGROUP = gl_WorkGroupSize.x;
const uint VECTORS = (COLUMNS + 3) / 4;
const uint V4 = V / 4;
const uint BATCH = 8;

layout(set = 0, binding = 0) readonly buffer Logits { float logits[]; };
layout(set = 0, binding = 1) readonly buffer Values { vec4 values[]; };
layout(set = 0, binding = 2) readonly buffer Tiles { uvec4 tiles[]; };
layout(set = 0, binding = 3) readonly buffer Offsets { uint offsets[]; };
layout(set = 0, binding = 4) writeonly buffer Partials { Partial partials[]; };
layout(push_constant) uniform Push { PointParameters p; };

// Four columns from SKIP + 4·vector on. Those past the last are arbitrary numbers, never read again.
vec4 columns(uint row, uint vector) {
  const uint at = SKIP / 4 + vector;
  const vec4 a = values[row * V4 + at];
  if (SKIP % 4 == 0) return a;
  const vec4 b = values[row * V4 + min(at + 1, V4 - 1)];
  return SKIP % 4 == 1 ? vec4(a.yzw, b.x) : SKIP % 4 == 2 ? vec4(a.zw, b.xy) : vec4(a.w, b.xyz);
}

void main() {
  const uvec4 tile = tiles[p.first_tile + gl_WorkGroupID.x];
  if (tile.w % 4 != 0) return;
  const uint begin = tile.y, end = min(begin + 128, offsets[tile.x + 1]);
  const uint chunk = offsets[tile.x] / 128 + tile.x + tile.w / 4;

  for (uint item = gl_LocalInvocationID.x; item < PARTS * CHANNELS * VECTORS; item += WORKGROUP) {
    const uint vector = item % VECTORS, channel = item / VECTORS % CHANNELS;
    const uint part = item / (VECTORS * CHANNELS);
    Partial sum = no_rows();
    for (uint first = begin + part; first < end; first += BATCH * PARTS) {
      float logit[BATCH];
      float largest = sum.largest;
      [[unroll]] for (uint i = 0; i < BATCH; ++i) {
        logit[i] = logits[(min(first + i * PARTS, end - 1) - p.first_row) * L + channel];
        largest = max(largest, first + i * PARTS < end ? logit[i] : sum.largest);
      }
      const float rescale = exp(sum.largest - largest);
      sum.largest = largest;
      sum.total *= rescale;
      sum.sums *= rescale;
      [[unroll]] for (uint i = 0; i < BATCH; ++i) {
        const uint row = first + i * PARTS;
        const float weight = row < end ? exp(logit[i] - largest) : 0.0;
        sum.total += weight;
        sum.sums += weight * columns(min(row, end - 1), vector);
      }
    }
    partials[chunk * PARTS * CHANNELS * VECTORS + item] = sum;
  }
}
