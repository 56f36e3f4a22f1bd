// pair_messages.comp: messages of a two-sided layer, for the edges where sector tables answer, an invocation per edge; see
// src/ops/pair_attention.hpp.
// in  0 features  f32[B·KEYS,F]  four degrees of IN0 … IN3 channels, padded to F, a multiple of 4
// in  1 order     u32[N·K,2]     of the run's edges: edge, neighbour
// in  2 positions f32[B·KEYS,8]  xyz of the source, xyz of the reference, 0 0
// con 3 heads     u32[TABLES,12] this and the next two: common/pair_tables.glsl
// in  4 rays      f32[R]
// in  5 sectors   f32[S,4]
// mod 6 messages  f32[N·K,M]     [values ; keys] by degree; padded to M, a multiple of 4
// out 7 rare      u32[N·K]       1: pair_networks.comp has to answer
// spec 0 WORKGROUP=32  1 K≤64  2 THIRD  3–6 IN  7–10 VALUES  11–14 KEYS  15 LINEAR  16 SEARCH≤16
// grid ceil(N·K / WORKGROUP) | shared 0 KiB
// loops ≤ IN4·(TABLES·SEARCH + 8·(VALUES + KEYS)·(1 + 32·6)) < 65535, as src/vk/pair_messages.cpp sees to
// error: see src/ops/pair_attention.hpp | fp32
#version 450
#extension GL_EXT_control_flow_attributes : require
#extension GL_GOOGLE_include_directive : require
#ifdef TEXELS
#define SHUFFLE
#endif
#ifdef SHUFFLE
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_shuffle : require
#endif
#include "common/pair_layer.glsl"
#include "common/parameters.glsl"
#include "common/pair_record.glsl"
#include "common/texels.glsl"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const uint K = 24;
layout(constant_id = 2) const uint THIRD = 0;

layout(set = 0, binding = 0) readonly buffer Features { float features[]; };
layout(set = 0, binding = 1) readonly buffer Order { uvec2 order[]; };
READ_VEC4S(2, Positions);
layout(set = 0, binding = 3) uniform Heads { uvec4 heads[3 * TABLES]; };
layout(set = 0, binding = 4) readonly buffer Rays { float rays[]; };
READ_VEC4S(5, Sectors);
layout(set = 0, binding = 6) buffer Messages { float messages[]; };
layout(set = 0, binding = 7) writeonly buffer Rare { uint rare[]; };
layout(push_constant) uniform Push { PairParameters p; };
#define SECTOR(at) VEC4_OF(Sectors, at)
#define POSITION(at) VEC4_OF(Positions, at)
#include "common/pair_edge.glsl"
#include "common/pair_tables.glsl"
#include "common/pair_columns.glsl"

PairEdge sides;
bool any_network = false;
vec4 turned[16];       // features in the frames, four channels
vec4 coefficient[9];   // one part's, four channels in, one out
vec3 message[3];       // rows: the first side's components

// Code for every degree d is written out where invocations share columns, since loops that hold loops unroll nowhere;
// looped elsewhere, where some drivers need gigabytes to compile code so long.
#ifdef SHUFFLE
#define UNROLL [[unroll]]
#define FOR_DEGREES(d, call)    \
  {                             \
    { const int d = 0; call; }  \
    { const int d = 1; call; }  \
    { const int d = 2; call; }  \
    { const int d = 3; call; }  \
  }
#else
#define UNROLL [[dont_unroll]]
#define FOR_DEGREES(d, call) [[dont_unroll]] for (int d = 0; d < 4; ++d) call
#endif

#define AXIS1(a) sides.source.axes[a]
#define AXIS2(a) sides.reference.axes[a]

void turn_features(uint row, uint quad) {
  UNROLL for (uint lane = 0; lane < 4u; ++lane) {
    const uint c = 4u * quad + lane;
    const vec3 first = c < IN2 ? vector_feature(row + FEATURE2 + 3u * c) : vec3(0);
    const vec3 second = c < IN1 ? vector_feature(row + FEATURE1 + 3u * c) : vec3(0);
    vec3 both[3];
    [[unroll]] for (int a = 0; a < 3; ++a)
      both[a] = c < IN3 ? vector_feature(row + FEATURE3 + 9u * c + 3u * a) : vec3(0);
    turned[0][lane] = c < IN0 ? features[row + c] : 0.0;
    [[unroll]] for (int a = 0; a < 3; ++a) {
      turned[COMPONENT(0, 1 + a)][lane] = dot(AXIS2(a), second);
      turned[COMPONENT(1 + a, 0)][lane] = dot(AXIS1(a), first);
      const vec3 half_turned = turn_back(AXIS1(a), both[0], both[1], both[2]);
      [[unroll]] for (int b = 0; b < 3; ++b) turned[COMPONENT(1 + a, 1 + b)][lane] = dot(AXIS2(b), half_turned);
    }
  }
}

void add_columns(const int n, const int columns, uint at, vec4 x, uint step) {
  first_sector(at);
  do {
    const vec4 y = at == sector ? x : vec4(0);
    UNROLL for (int row = 0; row < n * columns; row += ROWS_AT_ONCE) {
      const LOADED loaded = load_rows(row, n * columns, step);
      UNROLL for (int more = 0; more < ROWS_AT_ONCE; ++more)
        if (row + more < n * columns)
          coefficient[(row + more) % n] += y[(row + more) / n] * row_of(loaded, row, more, step);
    }
  } while (next_sector(at));
}

// In the frames, from degree (p, q) to (P, Q), whose coefficients are made.
void add_messages(const int P, const int Q, const int p, const int q) {
  const int n1 = P * p == 1 ? 3 : 1, n2 = Q * q == 1 ? 3 : 1;
  UNROLL for (int to = 0; to < n1 * n2; ++to)
    UNROLL for (int from = 0; from < n1 * n2; ++from)
      if (couples(n1, to / n2, from / n2) && couples(n2, to % n2, from % n2)) {
        const int f = (n1 == 1 ? 0 : frequency(to / n2, from / n2)) * n2 +
                      (n2 == 1 ? 0 : frequency(to % n2, from % n2));
        message[to / n2][to % n2] += side_sign(to / n2, from / n2) * side_sign(to % n2, from % n2) *
                                     dot(coefficient[f], turned[COMPONENT(p + from / n2, q + from % n2)]);
      }
}

vec4 x[6];  // for the tables to one degree out: what multiplies the columns, and where those begin
uint at[6];

void find_sector(const int i, const int table, uint shift) {
  const RadialInput found = radial_input(table, vec2(sides.source.norm, sides.reference.norm));
  x[i] = found.x;
  at[i] = found.columns + shift;
  any_network = any_network || found.network;
}

void find_sectors(const int from, const int to, const int set, uint shift) {
  const int table = set * SET + FIRST_TABLE(from, to), i = FIRST_TABLE(from, to) - FIRST_TABLE(0, to);
  find_sector(i, table, shift);
  if (TABLES_OF(from, to) == 2) find_sector(i + 1, table + 1, shift);
}

void add_part(const int from, const int P, const int Q, const int columns, uint o, uint step) {
  const int to = 2 * P + Q, i = FIRST_TABLE(from, to) - FIRST_TABLE(0, to);
  const int n = (P * (from / 2) == 1 ? 3 : 1) * (Q * (from % 2) == 1 ? 3 : 1);
  [[unroll]] for (int f = 0; f < n; ++f) coefficient[f] = vec4(0);
  add_columns(n, columns, at[i] + o, x[i], step);
  if (TABLES_OF(from, to) == 2) add_columns(n, columns, at[i + 1] + o, x[i + 1], step);
  add_messages(P, Q, from / 2, from % 2);
}

// To channels out of degree (P, Q), of input quad c. `set`: values, then keys, where they are apart.
void send(const int P, const int Q, const int set, uint c, uint edge, bool inside) {
  const int to = 2 * P + Q, columns = LINEAR && set == 0 ? 2 : 4;
  const uint begin = set == 1 ? VALUES(to) : 0u;
  const uint channels = LINEAR ? (set == 1 ? KEYS(to) : VALUES(to)) : MESSAGES(to), step = IN4 * channels;
  FOR_DEGREES(from, find_sectors(from, to, set, c * channels));
  uint o = 0;
  do {
    [[unroll]] for (int a = 0; a < 3; ++a) message[a] = vec3(0);
    FOR_DEGREES(from, add_part(from, P, Q, columns, o, step));
    if (Q == 1) {
      [[unroll]] for (int a = 0; a <= 2 * P; ++a) message[a] = turn_back(message[a], AXIS2(0), AXIS2(1), AXIS2(2));
    }
    if (P == 1) {
      const vec3 m0 = message[0], m1 = message[1], m2 = message[2];
      [[unroll]] for (int a = 0; a < 3; ++a) message[a] = AXIS1(0)[a] * m0 + AXIS1(1)[a] * m1 + AXIS1(2)[a] * m2;
    }
    const uint to_at = edge * MESSAGE_STRIDE + MESSAGE(to) + (begin + o) * DIM(to);
    if (inside) {
      [[unroll]] for (int a = 0; a <= 2 * P; ++a)
        [[unroll]] for (int b = 0; b <= 2 * Q; ++b) {
          const uint place = to_at + (2 * Q + 1) * a + b;
          messages[place] = IN4 > 1 && c > 0u ? messages[place] + message[a][b] : message[a][b];
        }
    }
  } while (++o < channels);
}

void main() {
  const uint edges = p.nodes * K;
  const bool inside = gl_GlobalInvocationID.x < edges;
  const uvec2 ends = order[min(gl_GlobalInvocationID.x, edges - 1u)];
  sides = pair_edge(p.first_node + ends.x / K, ends.y);
  for (uint c = 0; c < IN4; ++c) {
    turn_features(ends.y * FEATURE_STRIDE, c);
    FOR_DEGREES(to, send(to / 2, to % 2, 0, c, ends.x, inside));
    if (LINEAR) FOR_DEGREES(to, send(to / 2, to % 2, 1, c, ends.x, inside));
  }
  const bool plain = sides.source.norm >= DIRECTION_EPS && sides.reference.norm >= DIRECTION_EPS;
  if (inside) rare[ends.x] = plain && !any_network ? 0u : 1u;
}
