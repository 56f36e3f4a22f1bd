// copy.comp: copies vec4s, four per invocation: what memory can reach.
// in  0 from f32[n,4]
// out 1 to   f32[n,4]
// spec 0 WORKGROUP=64 | grid n/(4·WORKGROUP) | shared 0 KiB
// loops = 4 < 65535 | fp32
#version 450
#extension GL_EXT_control_flow_attributes : require

layout(local_size_x_id = 0) in;

layout(set = 0, binding = 0) readonly buffer From { vec4 from[]; };
layout(set = 0, binding = 1) writeonly buffer To { vec4 to[]; };

void main() {
  const uint begin = gl_WorkGroupID.x * 4 * gl_WorkGroupSize.x + gl_LocalInvocationID.x;
  [[unroll]] for (uint i = 0; i < 4; ++i) to[begin + i * gl_WorkGroupSize.x] = from[begin + i * gl_WorkGroupSize.x];
}
