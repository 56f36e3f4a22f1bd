// pair_networks.comp: messages of a two-sided layer, for the edges that pair_messages.comp leaves: where a norm's eps
// matters the radial networks themselves are evaluated, and directions shorter than their floor scale the kernel; see
// src/ops/sector_table.hpp. A work group looks at EDGES edges and answers the rare ones, one after the other.
// in  0 features  f32[B·KEYS,F]  four degrees of IN0 … IN3 channels, padded to F, a multiple of 4
// in  1 index     u32[N,K]       of the run's N nodes
// in  2 positions f32[B·KEYS,8]  xyz of the source, xyz of the reference, 0 0
// con 3 heads     u32[TABLES,12] this and the next two: common/pair_tables.glsl
// in  4 rays      f32[R]
// in  5 sectors   f32[S,4]
// out 6 messages  f32[N·K,M]     [values ; keys] by degree; padded to M, a multiple of 4
// in  7 rare      u32[N·K]       1: to be answered here
// spec 0 WORKGROUP=32  1 K≤64  2 EDGES≤32  3–6 IN  7–10 VALUES  11–14 KEYS  15 LINEAR  16 SEARCH≤16
// grid ceil(N·K / EDGES) | shared 352 + 8·EDGES + 256·IN4 + 156·TABLES + 4·M bytes ≤ 16 KiB
// loops ≤ EDGES·(8 + 64·IN4 + 40·TABLES + ⌈M/WORKGROUP⌉·(60 + 384·IN4)) < 65535, as src/vk/pair_attention.cpp sees to
// error: see src/ops/pair_attention.hpp | fp32
#version 450
#extension GL_EXT_control_flow_attributes : require
#extension GL_GOOGLE_include_directive : require
#include "common/pair_layer.glsl"
#include "common/parameters.glsl"
#include "common/projected_relu.glsl"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const uint K = 24;
layout(constant_id = 2) const uint EDGES = 32;

layout(set = 0, binding = 0) readonly buffer Features { float features[]; };
layout(set = 0, binding = 1) readonly buffer Index { uint index[]; };
layout(set = 0, binding = 2) readonly buffer Positions { vec4 positions[]; };
layout(set = 0, binding = 3) uniform Heads { uvec4 heads[3 * TABLES]; };
layout(set = 0, binding = 4) readonly buffer Rays { float rays[]; };
layout(set = 0, binding = 5) readonly buffer Sectors { vec4 sectors[]; };
layout(set = 0, binding = 6) writeonly buffer Messages { float messages[]; };
layout(set = 0, binding = 7) readonly buffer Rare { uint rare[]; };
layout(push_constant) uniform Push { PairParameters p; };
#include "common/pair_edge.glsl"
#include "common/pair_tables.glsl"

const uint LANES = gl_WorkGroupSize.x;
const uint WIDTH = 32, QUARTER = WIDTH / 4;  // the networks' layers: ops::radial_width
const uint QUADS = QUARTER + 1;              // their last layer's columns, four by four

// Where a network's parameters lie from its begin; a row of the second matrix takes a quarter of its width.
const uint GAIN1 = WIDTH / 2, BIAS1 = GAIN1 + QUARTER, W2 = BIAS1 + QUARTER, C2 = W2 + WIDTH * QUARTER;
const uint GAIN2 = C2 + QUARTER, BIAS2 = GAIN2 + QUARTER;

shared uint is_rare[EDGES], list[EDGES];
shared vec4 axis[6];                 // both sides' axes
shared vec4 turned[16 * IN4];        // features in the frames, by component 4·a + b, a and b of 0 | 1 2 3
shared vec4 factor[QUADS * TABLES];  // what multiplies a table's columns, four by four
shared uint column[TABLES];          // where they begin
shared uint quads[TABLES];           // how many fours
shared uint network[TABLES];         // the tables whose network has to be evaluated
shared vec4 hidden[2 * QUARTER];     // one network's: the first layer, activated, and the second, not yet
shared float message[MESSAGE_COUNT];

#define EXTENT(in, out) ((in) * (out) == 1 ? 3 : 1)
#define DEGREE(i) ((i) < MESSAGE1 ? 0 : (i) < MESSAGE2 ? 1 : (i) < MESSAGE3 ? 2 : 3)

void turn_features(uint from) {
  const uint row = from * FEATURE_STRIDE;
  for (uint i = gl_LocalInvocationID.x; i < 64u * IN4; i += LANES) {
    const uint c = i / 16u, a = i / 4u % 4u, b = i % 4u;
    const vec3 along1 = axis[a == 0u ? 0u : a - 1u].xyz, along2 = axis[b == 0u ? 3u : b + 2u].xyz;
    float x = 0.0;
    if (a == 0u && b == 0u) {
      if (c < IN0) x = features[row + c];
    } else if (a == 0u) {
      if (c < IN1) x = dot(along2, vector_feature(row + FEATURE1 + 3u * c));
    } else if (b == 0u) {
      if (c < IN2) x = dot(along1, vector_feature(row + FEATURE2 + 3u * c));
    } else if (c < IN3) {
      const uint at = row + FEATURE3 + 9u * c;
      x = dot(along1, vec3(dot(along2, vector_feature(at)), dot(along2, vector_feature(at + 3u)),
                           dot(along2, vector_feature(at + 6u))));
    }
    turned[(4u * a + b) * IN4 + c / 4u][c % 4u] = x;
  }
}

// The norm, from the variance, and LeakyReLU of unit j of a hidden layer, whose mean is zero already.
float activated(float x, float variance, uint j, uint gain, uint bias) {
  const float scale = variance > 0.0 ? 1.0 / sqrt(variance) : 0.0;
  return leaky(x * scale * sectors[gain + j / 4u][j % 4u] + sectors[bias + j / 4u][j % 4u]);
}

void evaluate_network(uint table, vec2 lengths) {
  const vec4 form = uintBitsToFloat(heads[3 * table + 1]);  // the first variance's, and eps
  const uint at = heads[3 * table + 2].x;
  const vec2 r = (heads[3 * table].w & SWAPPED) != 0u ? lengths.yx : lengths;
  const float first = form.x * r.x * r.x + form.y * r.x * r.y + form.z * r.y * r.y;
  for (uint j = gl_LocalInvocationID.x; j < WIDTH; j += LANES) {
    const vec4 w = sectors[at + j / 2u];
    const float x = dot(j % 2u == 0u ? w.xy : w.zw, r);
    hidden[j / 4u][j % 4u] = activated(x, first + form.w, j, at + GAIN1, at + BIAS1);
  }
  barrier();
  for (uint j = gl_LocalInvocationID.x; j < WIDTH; j += LANES) {
    float sum = sectors[at + C2 + j / 4u][j % 4u];
    for (uint i = 0; i < QUARTER; ++i) sum += dot(sectors[at + W2 + j * QUARTER + i], hidden[i]);
    hidden[QUARTER + j / 4u][j % 4u] = sum;
  }
  barrier();
  for (uint j = gl_LocalInvocationID.x; j < WIDTH; j += LANES) {
    float second = form.w;
    for (uint i = QUARTER; i < 2u * QUARTER; ++i) second += dot(hidden[i], hidden[i]) / WIDTH;
    factor[QUADS * table + j / 4u][j % 4u] =
        activated(hidden[QUARTER + j / 4u][j % 4u], second, j, at + GAIN2, at + BIAS2);
  }
}

// One of the two terms that make component `out` of degree P on one side.
struct Term {
  int degree;  // in
  int component;
  int freq;
  float sign;
};

Term side_term(int P, int component, int i) {
  if (P == 1 && component > 0)
    return Term(1, i == 0 ? component : 3 - component, 1 + i, i == 1 && component == 1 ? -1.0 : 1.0);
  return Term(i, 0, 0, 1.0);
}

// What a direction's norm below 1 makes of coefficient `freq`: a sum over others, of which this is a weight. |v|^J
// scales J; from degree 1 to 1, (c₀ + 2c₁)/3 belongs to J = 0, c₂ to J = 1 and the rest to J = 2.
float shortened(int from, int to, int freq, int other, float norm) {
  if (from != to || freq == 2) return norm;
  if (from == 0) return 1.0;
  const float rest = norm * norm, scalar = (other == 0 ? 1.0 : 2.0) * (1.0 - rest) / 3.0;
  return freq == other ? rest + scalar : scalar;
}

float one_message(int P, int Q, int a, int b, uint o, vec2 norm) {
  const int to = 2 * P + Q;
  const bool key = LINEAR && o >= VALUES(to);
  const uint channels = LINEAR ? (key ? KEYS(to) : VALUES(to)) : MESSAGES(to);
  const uint channel = key ? o - VALUES(to) : o;
  float sum = 0.0;
  for (int i = 0; i < 4; ++i) {
    const Term first = side_term(P, a, i / 2), second = side_term(Q, b, i % 2);
    const int from = 2 * first.degree + second.degree;
    const int n1 = EXTENT(first.degree, P), n2 = EXTENT(second.degree, Q);
    const uint table0 = (key ? SET : 0) + FIRST_TABLE(from, to);
    const uint step = IN4 * channels, rows = n1 * n2 * step;
    const int mixed1 = n1 == 3 && first.freq < 2 && norm.x < 1.0 ? 2 : 1;
    const int mixed2 = n2 == 3 && second.freq < 2 && norm.y < 1.0 ? 2 : 1;
    for (int j = 0; j < mixed1 * mixed2; ++j) {
      const int freq1 = mixed1 == 2 ? j / mixed2 : first.freq, freq2 = mixed2 == 2 ? j % 2 : second.freq;
      const float weight = shortened(first.degree, P, first.freq, freq1, norm.x) *
                           shortened(second.degree, Q, second.freq, freq2, norm.y);
      for (int c = 0; c < IN4; ++c) {
        vec4 coefficient = vec4(0);
        for (uint t = table0; t < table0 + TABLES_OF(from, to); ++t) {
          const uint at = column[t] + (n2 * freq1 + freq2) * step + c * channels + channel;
          for (uint quad = 0; quad < quads[t]; ++quad) {
            const vec4 x = factor[QUADS * t + quad];
            const uint row = at + 4u * quad * rows;
            coefficient += x.x * sectors[row] + x.y * sectors[row + rows];
            if (!LINEAR || key) coefficient += x.z * sectors[row + 2u * rows] + x.w * sectors[row + 3u * rows];
          }
        }
        const int component = 4 * (first.degree + first.component) + second.degree + second.component;
        sum += weight * first.sign * second.sign * dot(coefficient, turned[component * IN4 + c]);
      }
    }
  }
  return sum;
}

void answer(uint edge) {
  const PairEdge sides = pair_edge(p.first_node + edge / K, index[edge]);
  const vec2 lengths = vec2(sides.source.norm, sides.reference.norm);
  if (gl_LocalInvocationID.x == 0u) {
    [[unroll]] for (int a = 0; a < 3; ++a) {
      axis[a] = vec4(sides.source.axes[a], 0);
      axis[3 + a] = vec4(sides.reference.axes[a], 0);
    }
  }
  for (uint t = gl_LocalInvocationID.x; t < TABLES; t += LANES) {
    const RadialInput found = radial_input(t, lengths);
    factor[QUADS * t] = found.x;
    factor[QUADS * t + QUADS - 1] = vec4(1, 0, 0, 0);  // a network's offset
    column[t] = found.network ? heads[3 * t + 2].y : found.columns;
    quads[t] = found.network ? QUADS : 1;
  }
  barrier();
  turn_features(index[edge]);
  uint count = 0u;
  for (int t = 0; t < TABLES; ++t)
    if (quads[t] == QUADS) {
      if (gl_LocalInvocationID.x == 0u) network[count] = t;
      ++count;
    }
  barrier();
  for (uint i = 0; i < count; ++i) evaluate_network(network[i], lengths);
  barrier();

  const vec2 norm = min(lengths / DIRECTION_EPS, 1.0);
  for (int i = int(gl_LocalInvocationID.x); i < MESSAGE_COUNT; i += int(LANES)) {
    const int d = DEGREE(i), component = (i - MESSAGE(d)) % DIM(d), across = 2 * (d % 2) + 1;
    message[i] = one_message(d / 2, d % 2, component / across, component % across, (i - MESSAGE(d)) / DIM(d), norm);
  }
  barrier();
  for (int i = int(gl_LocalInvocationID.x); i < MESSAGE_COUNT; i += int(LANES)) {
    const int d = DEGREE(i), component = (i - MESSAGE(d)) % DIM(d), across = 2 * (d % 2) + 1;
    const int a = component / across, b = component % across;
    float sum = 0.0;
    for (int j = 0; j < DIM(d); ++j) {
      const float first = d < 2 ? 1.0 : axis[j / across][a], second = d % 2 == 0 ? 1.0 : axis[3 + j % across][b];
      sum += first * second * message[i - component + j];
    }
    messages[edge * MESSAGE_STRIDE + i] = sum;
  }
  barrier();
}

void main() {
  const uint first = gl_WorkGroupID.x * EDGES, edges = p.nodes * K;
  for (uint e = gl_LocalInvocationID.x; e < EDGES; e += LANES)
    is_rare[e] = first + e < edges ? rare[min(first + e, edges - 1u)] : 0u;
  barrier();
  uint count = 0u;
  for (uint e = 0; e < EDGES; ++e)
    if (is_rare[e] != 0u) {
      if (gl_LocalInvocationID.x == 0u) list[count] = first + e;
      ++count;
    }
  barrier();
  for (uint i = 0; i < count; ++i) answer(list[i]);
}
