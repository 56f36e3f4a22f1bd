// sinkhorn_stop.comp: which plans the last iteration but this changed by less than their tolerance: those stop, and what
// this iteration has done so far to the sources' potentials is of no effect. A work group takes a plan.
// in  0 plans  u32[plans,8] as in sinkhorn.comp
// in  1 blocks f32[P/64,4]  –, largest |last change|, Σ |change of the plan|, –
// mod 2 states u32[plans,4] whether it has stopped, after which iteration, –, –
// spec 0 WORKGROUP=64 | grid plans | shared 1 KiB
// loops ≤ 2·P/4096 + 70 with ≤ 400000 points of a cloud ≤ 270 | error: 1e-6 of the sum | fp32
#version 450
#extension GL_GOOGLE_include_directive : require
#include "common/parameters.glsl"

layout(local_size_x_id = 0) in;

layout(set = 0, binding = 0) readonly buffer Plans { uvec4 plans[]; };
layout(set = 0, binding = 1) readonly buffer Blocks { vec4 blocks[]; };
layout(set = 0, binding = 2) buffer States { uvec4 states[]; };
layout(push_constant) uniform Push { SinkhornParameters p; };

const uint BLOCK = 64;
shared vec4 totals[64];

// Largest changes of both sides' potentials, the sources' sum.
vec4 total_of(uint begin, uint end, bool of_source, uint lane) {
  vec4 total = vec4(0);
  for (uint b = begin / BLOCK + lane; b < (end + BLOCK - 1) / BLOCK; b += BLOCK) {
    const vec4 block = blocks[b];
    total = of_source ? vec4(max(total.x, block.y), 0, total.z + block.z, 0) : vec4(0, max(total.y, block.y), 0, 0);
  }
  return total;
}

void main() {
  const uint plan = p.first + gl_WorkGroupID.x, lane = gl_LocalInvocationID.x;
  const uvec4 rows = plans[2 * plan];
  totals[lane] = total_of(rows.x, rows.y, true, lane) + total_of(rows.z, rows.w, false, lane);
  barrier();
  for (uint half_size = BLOCK / 2; half_size > 0; half_size /= 2) {
    if (lane < half_size) {
      const vec4 a = totals[lane], b = totals[lane + half_size];
      totals[lane] = vec4(max(a.xy, b.xy), a.z + b.z, 0);
    }
    barrier();
  }
  const vec4 total = totals[0];
  if (lane == 0 && states[plan].x == 0 && total.x + total.y <= 1.0 &&
      total.z < uintBitsToFloat(plans[2 * plan + 1].z))
    states[plan] = uvec4(1, p.iteration - 1, 0, 0);
}
