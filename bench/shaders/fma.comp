// fma.comp: multiply-adds in registers, twelve independent chains per invocation: what arithmetic can reach.
// out 0 result f32[n]  one sum per invocation, so that nothing is left out
// spec 0 WORKGROUP=64 | grid any | shared 0 KiB
// loops = ROUNDS/8 = 256 < 65535 | fp32
#version 450
#extension GL_EXT_control_flow_attributes : require

layout(local_size_x_id = 0) in;
const int ROUNDS = 2048;

layout(set = 0, binding = 0) writeonly buffer Result { float result[]; };
struct FmaParameters {
  float factor, term;
};
layout(push_constant) uniform Push { FmaParameters p; };

void main() {
  vec4 a = vec4(gl_LocalInvocationID.x), b = a + 1.0, c = a + 2.0;
  for (int i = 0; i < ROUNDS / 8; ++i) {
    [[unroll]] for (int j = 0; j < 8; ++j) {
      a = a * p.factor + p.term;
      b = b * p.factor + p.term;
      c = c * p.factor + p.term;
    }
  }
  const vec4 sum = a + b + c;
  result[gl_GlobalInvocationID.x] = sum.x + sum.y + sum.z + sum.w;
}
