// pair_order.comp: the edges of a run in an order in which neighbours mostly share the sectors of radial tables: by the
// ratio of their lengths, in 4096 steps, then as they come. A work group sorts EDGES of them, digit by digit, each of
// its invocations so many in a row.
// in  0 index     u32[N,K]       of the run's N nodes
// in  1 positions f32[B·KEYS,8]  xyz of the source, xyz of the reference, 0 0
// mod 2 keys      u32[2,N·K]     ratios; the order by their low digits
// out 3 order     u32[N·K,2]     edge, neighbour
// spec 0 WORKGROUP=32  1 K≤64  2 EDGES | grid ceil(N·K / EDGES) | shared 8.3 KiB
// loops ≤ 8·⌈EDGES / WORKGROUP⌉ + 6·64 + 2·2048 / WORKGROUP < 65535 | error: exact | fp32
#version 450
#extension GL_GOOGLE_include_directive : require
#include "common/parameters.glsl"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const uint K = 24;
layout(constant_id = 2) const uint EDGES = 4096;
layout(set = 0, binding = 0) readonly buffer Index { uint index[]; };
layout(set = 0, binding = 1) readonly buffer Positions { vec4 positions[]; };
layout(set = 0, binding = 2) coherent buffer Keys { uint keys[]; };
layout(set = 0, binding = 3) writeonly buffer Order { uvec2 order[]; };
layout(push_constant) uniform Push { PairParameters p; };

const uint LANES = gl_WorkGroupSize.x, DIGITS = 64;
shared uint places[DIGITS * LANES];  // by digit and invocation: how many edges, then where the next one goes
shared uint totals[DIGITS];

uint key_of(uint edge) {
  const uint centre = 2u * (p.first_node + edge / K), neighbour = 2u * index[edge];
  const vec4 from0 = positions[neighbour], from1 = positions[neighbour + 1u];
  const vec4 to0 = positions[centre], to1 = positions[centre + 1u];
  const vec3 d1 = to0.xyz - from0.xyz, d2 = vec3(to0.w, to1.xy) - vec3(from0.w, from1.xy);
  const float r1 = sqrt(dot(d1, d1)), r2 = sqrt(dot(d2, d2));
  return min(uint(r2 / max(r1 + r2, 1e-37) * float(DIGITS * DIGITS)), DIGITS * DIGITS - 1u);
}

// From how many edges of a digit each invocation has to where they go.
void place_digits(uint lane, uint first) {
  barrier();
  for (uint d = lane; d < DIGITS; d += LANES) {
    uint total = 0u;
    for (uint i = 0; i < LANES; ++i) total += places[d * LANES + i];
    totals[d] = total;
  }
  barrier();
  for (uint d = lane; d < DIGITS; d += LANES) {
    uint at = first;
    for (uint before = 0; before < d; ++before) at += totals[before];
    for (uint i = 0; i < LANES; ++i) {
      const uint count = places[d * LANES + i];
      places[d * LANES + i] = at;
      at += count;
    }
  }
  barrier();
}

void main() {
  const uint lane = gl_LocalInvocationID.x, edges = p.nodes * K, first = gl_WorkGroupID.x * EDGES;
  const uint past = min(first + EDGES, edges), size = (past - first + LANES - 1u) / LANES;
  const uint begin = min(first + lane * size, past), end = min(begin + size, past);
  for (uint i = lane; i < DIGITS * LANES; i += LANES) places[i] = 0u;
  barrier();
  for (uint e = begin; e < end; ++e) {
    const uint key = key_of(e);
    keys[e] = key;
    ++places[key % DIGITS * LANES + lane];
  }
  place_digits(lane, first);
  for (uint e = begin; e < end; ++e) {
    const uint place = keys[e] % DIGITS * LANES + lane;
    keys[edges + places[place]] = e;
    ++places[place];
  }
  memoryBarrierBuffer();
  barrier();
  for (uint i = lane; i < DIGITS * LANES; i += LANES) places[i] = 0u;
  barrier();
  for (uint i = begin; i < end; ++i) ++places[keys[keys[edges + i]] / DIGITS * LANES + lane];
  place_digits(lane, first);
  for (uint i = begin; i < end; ++i) {
    const uint e = keys[edges + i], place = keys[e] / DIGITS * LANES + lane;
    order[places[place]] = uvec2(e, index[e]);
    ++places[place];
  }
}
