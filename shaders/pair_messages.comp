// pair_messages.comp: messages of a two-sided layer, for the edges where sector tables answer; see
// src/ops/pair_attention.hpp.
// in  0 features  f32[B·KEYS,F]  four degrees of IN0 … IN3 channels, padded to F, a multiple of 4
// in  1 index     u32[N,K]       of the run's N nodes
// in  2 positions f32[B·KEYS,8]  xyz of the source, xyz of the reference, 0 0
// con 3 heads     u32[TABLES,12] this and the next two: common/pair_tables.glsl
// in  4 rays      f32[R]
// in  5 sectors   f32[S,4]
// out 6 messages  f32[N·K,M]     [values ; keys] by degree; padded to M, a multiple of 4
// out 7 rare      u32[N·K]       1: pair_networks.comp has to answer
// spec 0 WORKGROUP=32  1 K≤64  2 EDGES≤16  3–6 IN  7–10 VALUES  11–14 KEYS  15 LINEAR  16 SEARCH≤16
// grid ceil(N·K / EDGES) | shared EDGES·(100 + 256·IN4 + 16·TABLES) bytes ≤ 16 KiB
// loops ≤ TABLES + ⌈EDGES·IN4/8⌉ + ⌈EDGES·TABLES/32⌉·(1 + SEARCH) + 4·⌈EDGES·(VALUES + KEYS)/32⌉·(2 + 24·IN4) < 65535,
//       as src/vk/pair_attention.cpp sees to
// error: with the rest of the layer 5e-5 of the largest output entry | fp32
#version 450
#extension GL_EXT_control_flow_attributes : require
#extension GL_GOOGLE_include_directive : require
#include "common/pair_layer.glsl"
#include "common/parameters.glsl"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const uint K = 24;
layout(constant_id = 2) const uint EDGES = 8;

layout(set = 0, binding = 0) readonly buffer Features { float features[]; };
layout(set = 0, binding = 1) readonly buffer Index { uint index[]; };
layout(set = 0, binding = 2) readonly buffer Positions { vec4 positions[]; };
layout(set = 0, binding = 3) uniform Heads { uvec4 heads[3 * TABLES]; };
layout(set = 0, binding = 4) readonly buffer Rays { float rays[]; };
layout(set = 0, binding = 5) readonly buffer Sectors { vec4 sectors[]; };
layout(set = 0, binding = 6) writeonly buffer Messages { float messages[]; };
layout(set = 0, binding = 7) writeonly buffer Rare { uint rare[]; };
layout(push_constant) uniform Push { PairParameters p; };
#include "common/pair_edge.glsl"
#include "common/pair_tables.glsl"

const uint LANES = gl_WorkGroupSize.x;
const uint NETWORK = 0x80000000u;

shared uint neighbour[EDGES];
shared vec4 axis[6 * EDGES];           // of both sides; w: the side's length
shared vec4 turned[16 * IN4 * EDGES];  // features in the frames, by component 4·a + b, a and b of 0 | 1 2 3
shared uvec4 radial[TABLES * EDGES];   // floats: factors of a table's columns but the last; where they begin, NETWORK

vec3 message[3];  // rows: the first side's components

void load_edges(uint first, uint edges) {
  for (uint e = gl_LocalInvocationID.x; e < EDGES; e += LANES) {
    const uint edge = min(first + e, edges - 1u);
    neighbour[e] = index[edge];
    const PairEdge sides = pair_edge(p.first_node + edge / K, index[edge]);
    [[unroll]] for (int a = 0; a < 3; ++a) {
      axis[6u * e + a] = vec4(sides.source.axes[a], sides.source.norm);
      axis[6u * e + 3u + a] = vec4(sides.reference.axes[a], sides.reference.norm);
    }
  }
}

void turn_features() {
  for (uint i = gl_LocalInvocationID.x; i < 4u * IN4 * EDGES; i += LANES) {
    const uint e = i / (4u * IN4), c = i % (4u * IN4);
    const uint row = neighbour[e] * FEATURE_STRIDE;
    const vec3 x1 = axis[6u * e].xyz, y1 = axis[6u * e + 1u].xyz, z1 = axis[6u * e + 2u].xyz;
    const vec3 x2 = axis[6u * e + 3u].xyz, y2 = axis[6u * e + 4u].xyz, z2 = axis[6u * e + 5u].xyz;
    const vec3 first = c < IN2 ? vector_feature(row + FEATURE2 + 3u * c) : vec3(0);
    const vec3 second = c < IN1 ? vector_feature(row + FEATURE1 + 3u * c) : vec3(0);
    vec3 both[3];
    [[unroll]] for (int a = 0; a < 3; ++a)
      both[a] = c < IN3 ? vector_feature(row + FEATURE3 + 9u * c + 3u * a) : vec3(0);

    const uint at = 16u * IN4 * e + c / 4u, lane = c % 4u;
    turned[at][lane] = c < IN0 ? features[row + c] : 0.0;
    const vec3 first_in = turn_into(first, x1, y1, z1), second_in = turn_into(second, x2, y2, z2);
    [[unroll]] for (int a = 0; a < 3; ++a) {
      turned[at + (1 + a) * IN4][lane] = second_in[a];
      turned[at + 4 * (1 + a) * IN4][lane] = first_in[a];
      const vec3 along = a == 0 ? x1 : a == 1 ? y1 : z1;
      const vec3 in_both = turn_into(turn_back(along, both[0], both[1], both[2]), x2, y2, z2);
      [[unroll]] for (int b = 0; b < 3; ++b) turned[at + (4 * (1 + a) + 1 + b) * IN4][lane] = in_both[b];
    }
  }
}

void find_sectors() {
  for (uint i = gl_LocalInvocationID.x; i < TABLES * EDGES; i += LANES) {
    const uint e = i % EDGES, table = i / EDGES;
    const RadialInput found = radial_input(table, vec2(axis[6u * e].w, axis[6u * e + 3u].w));
    radial[e * TABLES + table] = uvec4(floatBitsToUint(found.x.xyz), found.columns | (found.network ? NETWORK : 0u));
  }
}

// One side of the kernel in its frame: c on the axis and between degrees; from 1 to 1 also c₁·1 + c₂·𝒥 on the plane
// across the axis.
vec3 apply(const bool vectors, vec4 c[3], vec4 x, vec4 y, vec4 z) {
  return vectors ? vec3(dot(c[0], x), dot(c[1], y) - dot(c[2], z), dot(c[1], z) + dot(c[2], y))
                 : vec3(dot(c[0], x), 0, 0);
}

// To channel o of degree (P, Q). The first side's terms, (degree in, freq), go round in a loop, or the code is long
// to compile: (0,0), (1,0), and to degree 1 also (1,1), (1,2).
void add_messages(const int P, const int Q, uint e, uint o) {
  const int to = 2 * P + Q;
  const bool key = LINEAR && o >= VALUES(to);
  const uint channels = LINEAR ? (key ? KEYS(to) : VALUES(to)) : MESSAGES(to);
  const uint step = IN4 * channels;
  [[unroll]] for (int a = 0; a < 3; ++a) message[a] = vec3(0);
  [[dont_unroll]] for (uint i = 0; i < 2 * (1 + P) * IN4; ++i) {
    const uint term = i / IN4, c = i % IN4;
    const uint p = min(term, 1u), freq = term - p, n1 = P * p == 1u ? 3u : 1u;
    const uint channel = c * channels + (key ? o - VALUES(to) : o);
    [[unroll]] for (int q = 0; q < 2; ++q) {
      const bool vectors = q * Q == 1;
      const int n2 = vectors ? 3 : 1;
      const uint rows = n1 * n2 * step, first = e * TABLES + (key ? SET : 0) + FIRST_TABLE(2u * p + q, to);
      vec4 coefficient[3] = {vec4(0), vec4(0), vec4(0)};
      [[dont_unroll]] for (uint table = first; table < first + TABLES_OF(2u * p + q, to); ++table) {
        const uvec4 factors = radial[table];
        const vec3 x = uintBitsToFloat(factors.xyz);
        const uint at = (factors.w & ~NETWORK) + freq * n2 * step + channel;
        [[unroll]] for (int f = 0; f < n2; ++f)
          coefficient[f] += x.x * sectors[at + f * step] + x.y * sectors[at + rows + f * step];
        if (!LINEAR || key) {
          [[unroll]] for (int f = 0; f < n2; ++f)
            coefficient[f] += x.z * sectors[at + 2u * rows + f * step] + sectors[at + 3u * rows + f * step];
        }
      }

      const uint from = (16u * e + 4u * (p + freq) + q) * IN4 + c;
      const vec4 y = vectors ? turned[from + IN4] : vec4(0), z = vectors ? turned[from + 2 * IN4] : vec4(0);
      const vec3 along = apply(vectors, coefficient, turned[from], y, z);
      if (P == 0) {
        message[0] += along;
      } else {
        vec3 across = vec3(0);
        if (freq > 0u) {
          const uint other = (16u * e + 4u * (p + 3u - freq) + q) * IN4 + c;
          const vec4 y2 = vectors ? turned[other + IN4] : vec4(0), z2 = vectors ? turned[other + 2 * IN4] : vec4(0);
          across = apply(vectors, coefficient, turned[other], y2, z2);
        }
        message[0] += freq == 0u ? along : vec3(0);
        message[1] += freq == 1u ? along : freq == 2u ? -along : vec3(0);
        message[2] += across;
      }
    }
  }
}

void send(const int P, const int Q, uint first, uint edges) {
  const int to = 2 * P + Q;
  for (uint i = gl_LocalInvocationID.x; i < MESSAGES(to) * EDGES; i += LANES) {
    const uint e = i / MESSAGES(to), o = i % MESSAGES(to);
    add_messages(P, Q, e, o);
    if (Q == 1) {
      const vec3 x = axis[6u * e + 3u].xyz, y = axis[6u * e + 4u].xyz, z = axis[6u * e + 5u].xyz;
      [[unroll]] for (int a = 0; a <= 2 * P; ++a) message[a] = turn_back(message[a], x, y, z);
    }
    if (P == 1) {
      const vec3 x = axis[6u * e].xyz, y = axis[6u * e + 1u].xyz, z = axis[6u * e + 2u].xyz;
      const vec3 m0 = message[0], m1 = message[1], m2 = message[2];
      [[unroll]] for (int a = 0; a < 3; ++a) message[a] = x[a] * m0 + y[a] * m1 + z[a] * m2;
    }
    const uint at = (first + e) * MESSAGE_STRIDE + MESSAGE(to) + o * DIM(to);
    if (first + e < edges) {
      [[unroll]] for (int a = 0; a <= 2 * P; ++a)
        [[unroll]] for (int b = 0; b <= 2 * Q; ++b) messages[at + (2 * Q + 1) * a + b] = message[a][b];
    }
  }
}

void main() {
  const uint first = gl_WorkGroupID.x * EDGES, edges = p.nodes * K;
  load_edges(first, edges);
  barrier();
  turn_features();
  find_sectors();
  barrier();
  for (uint e = gl_LocalInvocationID.x; e < EDGES; e += LANES) {
    uint any = 0u;
    for (int t = 0; t < TABLES; ++t) any |= radial[e * TABLES + t].w;
    const bool plain = axis[6u * e].w >= DIRECTION_EPS && axis[6u * e + 3u].w >= DIRECTION_EPS;
    if (first + e < edges) rare[first + e] = plain ? any / NETWORK : 1u;
  }
  send(0, 0, first, edges);
  send(0, 1, first, edges);
  send(1, 0, first, edges);
  send(1, 1, first, edges);
}
