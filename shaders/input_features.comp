// input_features.comp: what a point starts with, from its attributes, an invocation per point; see
// src/ops/input_features.hpp.
// in  0 colors   f32[P,4]      r g b; without COLORS one row, which begins with the constant
// in  1 normals  f32[P,4]      xyz; not read without NORMALS
// in  2 offsets  f32[P,4]      xyz; not read without OFFSETS
// in  3 tiles    u32[tiles,4]
// out 4 features f32[P,F4]     COLORS ? 3 : 1 scalars, with OFFSETS a length and, with NORMALS as well, a product;
//                              then the vectors there are (y, z, x); padded to F4
// spec 0 WORKGROUP=32  1 COLORS  2 NORMALS  3 OFFSETS | grid tiles | shared 0 KiB
// loops none | error: see src/ops/input_features.hpp | fp32
#version 450
#extension GL_EXT_control_flow_attributes : require
#extension GL_GOOGLE_include_directive : require
#include "common/parameters.glsl"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const bool COLORS = true;
layout(constant_id = 2) const bool NORMALS = true;
layout(constant_id = 3) const bool OFFSETS = true;

const int LENGTH = COLORS ? 3 : 1;
const int NORMAL = LENGTH + (OFFSETS ? 1 : 0) + (OFFSETS && NORMALS ? 1 : 0);
const int OFFSET = NORMAL + (NORMALS ? 3 : 0);
const int F4 = (OFFSET + (OFFSETS ? 3 : 0) + 3) / 4;

layout(set = 0, binding = 0) readonly buffer Colors { vec4 colors[]; };
layout(set = 0, binding = 1) readonly buffer Normals { vec4 normals[]; };
layout(set = 0, binding = 2) readonly buffer Offsets { vec4 offsets[]; };
layout(set = 0, binding = 3) readonly buffer Tiles { uvec4 tiles[]; };
layout(set = 0, binding = 4) writeonly buffer Features { vec4 features[]; };
layout(push_constant) uniform Push { TileParameters p; };

void main() {
  const uvec4 tile = tiles[p.first_tile + gl_WorkGroupID.x];
  const uint row = tile.y + gl_LocalInvocationID.x;
  if (row >= tile.z) return;
  const vec3 color = colors[COLORS ? row : 0].xyz;
  const vec3 normal = NORMALS ? normals[row].xyz : vec3(0), offset = OFFSETS ? offsets[row].xyz : vec3(0);

  float f[4 * F4];
  [[unroll]] for (int i = OFFSET; i < 4 * F4; ++i) f[i] = 0.0;
  [[unroll]] for (int i = 0; i < LENGTH; ++i) f[i] = color[i];
  if (OFFSETS) {
    f[LENGTH] = sqrt(dot(offset, offset));
    if (NORMALS) f[NORMAL - 1] = dot(normal, offset);
  }
  if (NORMALS) {
    [[unroll]] for (int i = 0; i < 3; ++i) f[NORMAL + i] = normal[(i + 1) % 3];
  }
  if (OFFSETS) {
    [[unroll]] for (int i = 0; i < 3; ++i) f[OFFSET + i] = offset[(i + 1) % 3];
  }
  [[unroll]] for (int i = 0; i < F4; ++i)
    features[row * F4 + i] = vec4(f[4 * i], f[4 * i + 1], f[4 * i + 2], f[4 * i + 3]);
}
