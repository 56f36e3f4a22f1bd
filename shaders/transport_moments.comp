// transport_moments.comp: what Procrustes needs of a transport plan: of every source point how much of it is transported, and
// in which direction. An invocation takes a row, a work group a block of 64 neighbours, as in sinkhorn.comp.
// in  0 points     f32[P,4·(1+NORMALS)] xyz, normal; in kernel widths; a cloud begins at a multiple of 64
// in  1 boxes      f32[P/64,8]  low corner, 0, high corner, 0
// in  2 tiles      u32[tiles,4] plan, first row, row past the last, 0
// in  3 plans      u32[plans,8] as in sinkhorn.comp
// in  4 potentials f32[2P,4]    as there
// in  5 blocks     f32[P/64,4]  largest potential, –, –, –
// in  6 states     u32[plans,4] whether it has stopped, after which iteration, –, –
// out 7 moments    f32[P,8]     Σ P, Σ P (y − x), Σ P (normal − normal), 0
// spec 0 WORKGROUP=64  1 NORMALS | grid tiles | shared 0.25 KiB
// loops ≤ 10·P/64 + 200 with ≤ 400000 points of a cloud ≤ 62700 < 65535 | error: 1e-6 of the largest moment | fp32
#version 450
#extension GL_EXT_control_flow_attributes : require
#extension GL_GOOGLE_include_directive : require
#ifdef SHUFFLE
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_shuffle : require
#endif
#include "common/parameters.glsl"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const bool NORMALS = false;

layout(set = 0, binding = 0) readonly buffer Points { vec4 points[]; };
layout(set = 0, binding = 1) readonly buffer Boxes { vec4 boxes[]; };
layout(set = 0, binding = 2) readonly buffer Tiles { uvec4 tiles[]; };
layout(set = 0, binding = 3) readonly buffer Plans { uvec4 plans[]; };
layout(set = 0, binding = 4) readonly buffer Potentials { vec4 potentials[]; };
layout(set = 0, binding = 5) readonly buffer Blocks { vec4 blocks[]; };
layout(set = 0, binding = 6) readonly buffer States { uvec4 states[]; };
layout(set = 0, binding = 7) writeonly buffer Moments { vec4 moments[]; };
layout(push_constant) uniform Push { SinkhornParameters p; };

#include "common/transport_plan.glsl"

shared float shared_bound[64];

void main() {
  const uint lane = gl_LocalInvocationID.x;
  const uvec4 tile = tiles[p.first + gl_WorkGroupID.x];
  const uint row = min(tile.y + lane, tile.z - 1);
  const uvec4 rows = plans[2 * tile.x], state = states[tile.x];
  const uint iteration = state.x == 0 ? p.iteration : state.y;
  const vec4 own = potentials[row + (iteration & 1u) * p.rows];
  const vec3 position = points[row * WIDTH].xyz, normal = NORMALS ? points[row * WIDTH + 1].xyz : vec3(0);
  const uint own_block = tile.y / BLOCK, blocks_end = (rows.w + BLOCK - 1) / BLOCK;
  const vec3 low = boxes[2 * own_block].xyz, high = boxes[2 * own_block + 1].xyz;

  shared_bound[lane] = own.x + own.y;
  barrier();
  float most = own.x + own.y;
  for (uint i = 0; i < BLOCK; ++i) most = max(most, shared_bound[i]);
  barrier();

  float weight = 0;
  vec3 away = vec3(0), turned = vec3(0);
  for (uint chunk = rows.z / BLOCK; chunk < blocks_end; chunk += BLOCK) {
    const uint b = min(chunk + lane, blocks_end - 1);
    shared_bound[lane] = blocks[b].x - squared_gap(low, high, boxes[2 * b].xyz, boxes[2 * b + 1].xyz);
    barrier();
    const uint count = min(BLOCK, blocks_end - chunk);
    for (uint i = 0; i < count; ++i) {
      if (shared_bound[i] + most < -NEGLIGIBLE) continue;
      const uint end = min((chunk + i + 1) * BLOCK, rows.w);
      for (uint base = (chunk + i) * BLOCK; base < end; base += BATCH) {
        const Loaded loaded = load_batch(base, end, 0);
        [[unroll]] for (int j = 0; j < BATCH; ++j) {
          const Term term = term_of(position, normal, loaded, base, end, 0, j);
          const float part = exp(term.coarse + own.x + (term.rest + own.y));
          weight += part;
          away += part * term.away;
          turned += part * term.turned;
        }
      }
    }
    barrier();
  }
  if (tile.y + lane < tile.z) {
    moments[2 * row] = vec4(weight, away);
    moments[2 * row + 1] = vec4(turned, 0);
  }
}
