// Moves every point by a pose: a shader of the application's.
#version 450
layout(local_size_x = 64) in;
layout(set = 0, binding = 0) readonly buffer Pose { float pose[16]; };  // row-major
layout(set = 0, binding = 1) readonly buffer Points { float points[]; };
layout(set = 0, binding = 2) writeonly buffer Moved { float moved[]; };
layout(push_constant) uniform Push { uint count; };

void main() {
  const uint i = gl_GlobalInvocationID.x;
  if (i >= count) return;
  const vec4 x = vec4(points[3 * i], points[3 * i + 1], points[3 * i + 2], 1);
  for (uint a = 0; a < 3; ++a)
    moved[3 * i + a] = dot(vec4(pose[4 * a], pose[4 * a + 1], pose[4 * a + 2], pose[4 * a + 3]), x);
}
