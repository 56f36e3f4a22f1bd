// softmax_normaliser.comp: the largest logit of every channel over a cloud, and the sum of exponentials relative to it,
// a work group per cloud and four channels; see src/ops/softmax_sum.hpp. The order depends on nothing but the cloud's
// own number of rows.
// in  0 logits     f32[P,L]      rows padded to L, a multiple of 4
// in  1 offsets    u32[S+1]      cloud s owns rows offsets[s] .. offsets[s+1]
// out 2 normaliser f32[S,L/4,8]  four largest logits, one over the sums
// spec 0 WORKGROUP=128  1 L | grid L/4 × clouds | shared 4 KiB
// loops ≤ rows/512 + 8; with ≤ 16 Mi rows of a cloud ≤ 32776 < 65535 | error: see src/ops/softmax_sum.hpp | fp32
#version 450
#extension GL_EXT_control_flow_attributes : require
#extension GL_GOOGLE_include_directive : require
#include "common/parameters.glsl"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const uint L = 32;

const uint WORKGROUP = gl_WorkGroupSize.x;
const uint L4 = L / 4;
const uint BATCH = 4;

layout(set = 0, binding = 0) readonly buffer Logits { vec4 logits[]; };
layout(set = 0, binding = 1) readonly buffer Offsets { uint offsets[]; };
layout(set = 0, binding = 2) writeonly buffer Normaliser { vec4 normaliser[]; };
layout(push_constant) uniform Push { SegmentParameters p; };

shared vec4 largest_of[WORKGROUP], total_of[WORKGROUP];

void main() {
  const uint cloud = p.first + gl_WorkGroupID.y, column = gl_WorkGroupID.x, lane = gl_LocalInvocationID.x;
  const uint begin = offsets[cloud], end = offsets[cloud + 1];

  // Finite, so that the difference of two such is a number.
  vec4 largest = vec4(-3.4e38), total = vec4(0);
  for (uint first = begin + lane; first < end; first += BATCH * WORKGROUP) {
    vec4 logit[BATCH];
    vec4 next = largest;
    [[unroll]] for (uint i = 0; i < BATCH; ++i) {
      const uint row = first + i * WORKGROUP;
      logit[i] = row < end ? logits[row * L4 + column] : vec4(-3.4e38);
      next = max(next, logit[i]);
    }
    total *= exp(largest - next);
    [[unroll]] for (uint i = 0; i < BATCH; ++i) total += exp(logit[i] - next);
    largest = next;
  }
  largest_of[lane] = largest, total_of[lane] = total;
  for (uint reach = WORKGROUP / 2; reach > 0; reach /= 2) {
    barrier();
    if (lane < reach) {
      const vec4 a = largest_of[lane], b = largest_of[lane + reach], both = max(a, b);
      total_of[lane] = total_of[lane] * exp(a - both) + total_of[lane + reach] * exp(b - both);
      largest_of[lane] = both;
    }
  }
  if (lane == 0) {
    normaliser[(cloud * L4 + column) * 2] = largest_of[0];
    normaliser[(cloud * L4 + column) * 2 + 1] = 1.0 / total_of[0];
  }
}
