// gather_edges.comp: what a row's own record holds for it, and what the edges from it send, summed in the order of the
// edges; or what the edges to it get less what those from it send. An invocation per row and PART of its vec4s, which
// share a cache line.
// in  0 begins u32[P]      where a row's edges begin in list[]
// in  1 counts u32[P]
// in  2 list   u32[Q·K]
// in  3 edges  f32[E,4·EDGE] from first_edge on
// in  4 record f32[Q,4·RECORD] from first_row on
// in  5 tiles  u32[tiles,4]
// out 6 result f32[P,F]
// spec 0 WORKGROUP=32  1 QUADS  2 RECORD  3 OWN  4 FLAGS  5 EDGE  6 AT  7 K≤64  8 PART
// grid (tiles, ceil(QUADS / PART)) | shared 0 KiB
// loops ≤ K + edges from a row < 65535 | error: see src/ops/gradient.hpp | fp32
#version 450
#extension GL_EXT_control_flow_attributes : require
#extension GL_GOOGLE_include_directive : require
#include "common/parameters.glsl"
#include "common/texels.glsl"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const uint QUADS = 4;   // vec4s of a row
layout(constant_id = 2) const uint RECORD = 64; // vec4s of a record
layout(constant_id = 3) const uint OWN = 0;     // where the row's own part begins in it
layout(constant_id = 4) const uint FLAGS = 3;
layout(constant_id = 5) const uint EDGE = 4;     // vec4s of an edge
layout(constant_id = 6) const uint AT = 0;       // where the columns begin in them
layout(constant_id = 7) const uint K = 24;
layout(constant_id = 8) const uint PART = 4;

const bool HAS_OWN = (FLAGS & 1u) != 0u, HAS_EDGES = (FLAGS & 2u) != 0u, BOTH_ENDS = (FLAGS & 4u) != 0u;

layout(set = 0, binding = 0) readonly buffer Begins { uint begins[]; };
layout(set = 0, binding = 1) readonly buffer Counts { uint counts[]; };
layout(set = 0, binding = 2) readonly buffer List { uint list[]; };
READ_VEC4S(3, Edges);
READ_VEC4S(4, Record);
layout(set = 0, binding = 5) readonly buffer Tiles { uvec4 tiles[]; };
layout(set = 0, binding = 6) writeonly buffer Result { vec4 result[]; };
layout(push_constant) uniform Push { GatherParameters p; };

// The last part repeats what the one before it has, where QUADS is no multiple of PART.
void main() {
  const uvec4 tile = tiles[p.first_tile + gl_WorkGroupID.x];
  const uint row = min(tile.y + gl_LocalInvocationID.x, tile.z - 1);
  const uint first = min(gl_WorkGroupID.y * PART, QUADS - PART);
  vec4 sum[PART];
  [[unroll]] for (uint i = 0; i < PART; ++i) sum[i] = vec4(0);
  if (HAS_OWN) {
    [[unroll]] for (uint i = 0; i < PART; ++i) sum[i] = VEC4_OF(Record, (row - p.first_row) * RECORD + OWN + first + i);
  }
  if (HAS_EDGES) {
    const uint begin = begins[row], end = begin + counts[row];
    for (uint e = begin; e < end; ++e) {
      const uint at = (list[e] - p.first_edge) * EDGE + AT + first;
      [[unroll]] for (uint i = 0; i < PART; ++i) sum[i] += VEC4_OF(Edges, at + i);
    }
  }
  if (BOTH_ENDS) {
    [[unroll]] for (uint i = 0; i < PART; ++i) sum[i] = -sum[i];
    for (uint j = 0; j < K; ++j) {
      const uint at = (row * K + j - p.first_edge) * EDGE + AT + first;
      [[unroll]] for (uint i = 0; i < PART; ++i) sum[i] += VEC4_OF(Edges, at + i);
    }
  }
  if (tile.y + gl_LocalInvocationID.x < tile.z) {
    [[unroll]] for (uint i = 0; i < PART; ++i) result[row * QUADS + first + i] = sum[i];
  }
}
