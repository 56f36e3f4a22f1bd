// export_poses.comp: poses between the clouds' own frames from those between their centroids, as 4×4 matrices.
// in  0 pose      f32[B,16]   see src/ops/pose.hpp
// in  1 centroids f32[2B,4]
// out 2 matrices  f32[B,16]   row-major, T_reference_source; last row 0 0 0 1
// spec 0 WORKGROUP=32 | grid ceil(B / WORKGROUP) | shared 0 KiB
// loops ≤ 3 < 65535 | error: 1e-6 of the centroid's distance | fp32
#version 450
#extension GL_GOOGLE_include_directive : require
#include "common/parameters.glsl"

layout(local_size_x_id = 0) in;

layout(set = 0, binding = 0) readonly buffer PoseRows { float pose[]; };
layout(set = 0, binding = 1) readonly buffer Centroids { vec4 centroids[]; };
layout(set = 0, binding = 2) writeonly buffer Matrices { float matrices[]; };
layout(push_constant) uniform Push { CloudParameters p; };

void main() {
  const uint pair = gl_GlobalInvocationID.x, pairs = p.clouds / 2;
  if (pair >= pairs) return;
  const vec3 source = centroids[pair].xyz;
  const vec4 reference = centroids[pairs + pair];
  const uint at = 16 * pair;
  for (uint i = 0; i < 3; ++i) {
    const vec3 row = vec3(pose[at + 3 * i], pose[at + 3 * i + 1], pose[at + 3 * i + 2]);
    matrices[at + 4 * i] = row.x;
    matrices[at + 4 * i + 1] = row.y;
    matrices[at + 4 * i + 2] = row.z;
    matrices[at + 4 * i + 3] = pose[at + 9 + i] - dot(row, source) + reference[i];
  }
  matrices[at + 12] = 0.0;
  matrices[at + 13] = 0.0;
  matrices[at + 14] = 0.0;
  matrices[at + 15] = 1.0;
}
