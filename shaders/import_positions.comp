// import_positions.comp: a host's clouds, each moved to its centroid, a work group per cloud.
// in  0 sources    f32[points,STRIDE]  xyz, then whatever the host keeps behind them
// in  1 references f32[points,STRIDE]
// in  2 offsets    u32[2B+1]  rows of the sources' clouds, then of the references'
// out 3 positions  f32[P,4]   xyz, 0
// out 4 centroids  f32[2B,4]
// spec 0 WORKGROUP=128  1 STRIDE=3 | grid 2B | shared 1.5 KiB
// loops ≤ 2·points/128 + 7 < 65535 | error: 1e-6 of the cloud's extent in the centroid | fp32
#version 450
#extension GL_GOOGLE_include_directive : require
#include "common/parameters.glsl"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const uint STRIDE = 3;
const uint LANES = 128;

layout(set = 0, binding = 0) readonly buffer Sources { float sources[]; };
layout(set = 0, binding = 1) readonly buffer References { float references[]; };
layout(set = 0, binding = 2) readonly buffer Offsets { uint offsets[]; };
layout(set = 0, binding = 3) writeonly buffer Positions { vec4 positions[]; };
layout(set = 0, binding = 4) writeonly buffer Centroids { vec4 centroids[]; };
layout(push_constant) uniform Push { CloudParameters p; };

shared float sums[3 * LANES];

vec3 host_point(bool reference, uint row) {
  const uint at = row * STRIDE;
  return reference ? vec3(references[at], references[at + 1], references[at + 2])
                   : vec3(sources[at], sources[at + 1], sources[at + 2]);
}

void main() {
  const uint cloud = gl_WorkGroupID.x, lane = gl_LocalInvocationID.x;
  const bool reference = cloud >= p.clouds / 2;
  const uint begin = offsets[cloud], end = offsets[cloud + 1];
  const uint skipped = reference ? offsets[p.clouds / 2] : 0;

  // Sums of differences from the first point: far-away clouds lose nothing.
  const vec3 first = host_point(reference, begin - skipped);
  vec3 sum = vec3(0);
  for (uint row = begin + lane; row < end; row += LANES) sum += host_point(reference, row - skipped) - first;
  sums[3 * lane] = sum.x, sums[3 * lane + 1] = sum.y, sums[3 * lane + 2] = sum.z;
  barrier();
  for (uint half_lanes = LANES / 2; half_lanes > 0; half_lanes /= 2) {
    if (lane < half_lanes)
      for (uint a = 0; a < 3; ++a) sums[3 * lane + a] += sums[3 * (lane + half_lanes) + a];
    barrier();
  }
  const vec3 mean = vec3(sums[0], sums[1], sums[2]) / float(end - begin);
  if (lane == 0) centroids[cloud] = vec4(first + mean, 0);
  for (uint row = begin + lane; row < end; row += LANES)
    positions[row] = vec4(host_point(reference, row - skipped) - first - mean, 0);
}
