// input_features.comp: a point's colour (or a constant) and normal become its first feature, an invocation
// per point; see src/ops/input_features.hpp.
// in  0 colors   f32[P,4]      r g b; without COLORS one row, which begins with the constant
// in  1 normals  f32[P,4]      xyz; not read without NORMALS
// in  2 tiles    u32[tiles,4]
// out 3 features f32[P,F4]     COLORS ? 3 : 1 scalars, then with NORMALS one vector (y, z, x); padded to F4
// spec 0 WORKGROUP=32  1 COLORS  2 NORMALS | grid tiles | shared 0 KiB
// loops none | error: none | fp32
#version 450
#extension GL_GOOGLE_include_directive : require
#include "common/parameters.glsl"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const bool COLORS = true;
layout(constant_id = 2) const bool NORMALS = true;

const uint F4 = COLORS && NORMALS ? 2 : 1;

layout(set = 0, binding = 0) readonly buffer Colors { vec4 colors[]; };
layout(set = 0, binding = 1) readonly buffer Normals { vec4 normals[]; };
layout(set = 0, binding = 2) readonly buffer Tiles { uvec4 tiles[]; };
layout(set = 0, binding = 3) writeonly buffer Features { vec4 features[]; };
layout(push_constant) uniform Push { TileParameters p; };

void main() {
  const uvec4 tile = tiles[p.first_tile + gl_WorkGroupID.x];
  const uint row = tile.y + gl_LocalInvocationID.x;
  if (row >= tile.z) return;
  const vec3 color = colors[COLORS ? row : 0].xyz;
  const vec3 normal = NORMALS ? normals[row].yzx : vec3(0);
  if (!COLORS) {
    features[row] = vec4(color.x, normal);
  } else {
    features[row * F4] = vec4(color, normal.x);
    if (NORMALS) features[row * F4 + 1] = vec4(normal.yz, 0, 0);
  }
}
