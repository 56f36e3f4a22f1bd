// knn.comp: exact k nearest neighbours within each segment (cloud or pair) of a batch; see src/ops/knn.hpp.
// in  0 queries    f32[Q,D4]     D = DIM coordinates, padded to D4, a multiple of 4; model units
// in  1 references f32[P,D4]     segment s owns rows offsets[s] .. offsets[s+1]
// in  2 tiles      u32[tiles,4]  segment, first query, query past the last, tile within the segment
// in  3 offsets    u32[S+1]
// out 4 index      u32[Q,K]      ascending (distance, index); ties → lower index; of the nearest K · DILATION, every
//                                DILATION-th; K · DILATION ≤ 128
// mod 5 found      u32[Q,K·DILATION,2] squared distance and row, between dispatches over parts of the references
// spec 0 WORKGROUP=32  1 K≤64  2 DIM≤8  3 EXCLUDE_SELF  4 DILATION≤16 | grid tiles | shared 0 KiB
// loops ≤ 4·references/8 + references/4 ≤ 24576 < 65535 | error: indices equal to cpu/knn | fp32
#version 450
#extension GL_EXT_control_flow_attributes : require
#extension GL_GOOGLE_include_directive : require
#ifdef SHUFFLE
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_shuffle : require
#extension GL_KHR_shader_subgroup_vote : require
#endif
#include "common/parameters.glsl"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const int K = 24;
layout(constant_id = 2) const int DIM = 3;
layout(constant_id = 3) const bool EXCLUDE_SELF = true;
layout(constant_id = 4) const int DILATION = 1;

const int NEAREST = K * DILATION;
const int VECTORS = (DIM + 3) / 4;
const int BATCH = 8, AT_ONCE = 4;  // candidates loaded together, and put into the list together
#define INFINITY uintBitsToFloat(0x7f800000u)

layout(set = 0, binding = 0) readonly buffer Queries { vec4 queries[]; };
layout(set = 0, binding = 1) readonly buffer References { vec4 references[]; };
layout(set = 0, binding = 2) readonly buffer Tiles { uvec4 tiles[]; };
layout(set = 0, binding = 3) readonly buffer Offsets { uint offsets[]; };
layout(set = 0, binding = 4) writeonly buffer Index { uint index[]; };
layout(set = 0, binding = 5) buffer Found { uvec2 found[]; };
layout(push_constant) uniform Push { KnnParameters p; };

vec4 candidate(vec4 loaded, uint row, int i) {
#ifdef SHUFFLE
  return subgroupShuffle(loaded, i);
#else
  return references[row];
#endif
}

// `before` and the squares of `dims` coordinates, added one by one. Never contracted into fused multiply-adds: ties must
// be ties on every device.
float squared(float before, vec4 a, vec4 b, int dims) {
  precise vec4 d = a - b;
  precise vec4 square = d * d;
  precise float sum = before + square.x;
  if (dims > 1) sum = sum + square.y;
  if (dims > 2) sum = sum + square.z;
  if (dims > 3) sum = sum + square.w;
  return sum;
}

vec4 query0, query1, loaded0, loaded1;

void load_batch(uint base, uint step, uint end) {
#ifdef SHUFFLE
  const uint loaded_row = min(base + (gl_SubgroupInvocationID & 7u) * step, end - 1) * VECTORS;
#else
  const uint loaded_row = 0;
#endif
  loaded0 = references[loaded_row];
  loaded1 = VECTORS > 1 ? references[loaded_row + 1] : vec4(0);
}

// The squared distance of the i-th of a batch; infinite past the end, and for the query itself.
float distance_of(uint base, uint step, int i, uint end, uint self) {
  const uint row = base + i * step, from = min(row, end - 1);
  float sum = squared(0.0, query0, candidate(loaded0, from * VECTORS, i), DIM);
  if (VECTORS > 1) sum = squared(sum, query1, candidate(loaded1, from * VECTORS + 1, i), DIM - 4);
  return row < end && !(EXCLUDE_SELF && row == self) ? sum : INFINITY;
}

bool any_wants(bool wants) {
#ifdef SHUFFLE
  return subgroupAny(wants);
#else
  return wants;
#endif
}

// By distance, then row.
void sort_batch(inout float d[BATCH], inout uint from[BATCH]) {
  const int comparisons = 19, pairs[2 * comparisons] =
      int[](0, 1, 2, 3, 4, 5, 6, 7, 0, 2, 1, 3, 4, 6, 5, 7, 1, 2, 5, 6, 0, 4, 3, 7, 1, 5, 2, 6, 1, 4, 3, 6, 2, 4, 3, 5,
            3, 4);
  [[unroll]] for (int c = 0; c < comparisons; ++c) {
    const int a = pairs[2 * c], b = pairs[2 * c + 1];
    const float da = d[a], db = d[b];
    const uint ra = from[a], rb = from[b];
    const bool exchange = db < da || (db == da && rb < ra);
    d[a] = exchange ? db : da;
    d[b] = exchange ? da : db;
    from[a] = exchange ? rb : ra;
    from[b] = exchange ? ra : rb;
  }
}

// Where many are wanted, most of the time goes into making room among those found, so that it pays to know beforehand how
// far they can be: the least of a few distances, around one estimated from a sample, that NEAREST are within.
const int SAMPLED = 16, BOUNDS = 8, SAMPLE_STEP = NEAREST > SAMPLED ? NEAREST / SAMPLED : 1;
const bool BOUNDED = NEAREST > 32;

float find_bound(uint begin, uint end, uint self) {
  float least[SAMPLED];
  [[unroll]] for (int j = 0; j < SAMPLED; ++j) least[j] = INFINITY;
  for (uint base = begin; base < end; base += BATCH * SAMPLE_STEP) {
    load_batch(base, SAMPLE_STEP, end);
    [[unroll]] for (int i = 0; i < BATCH; ++i) {
      float d = distance_of(base, SAMPLE_STEP, i, end, self);
      [[unroll]] for (int j = 0; j < SAMPLED; ++j) {
        const float before = least[j];
        least[j] = min(before, d);
        d = max(before, d);
      }
    }
  }
  float bounds[BOUNDS];
  uint nearer[BOUNDS];
  [[unroll]] for (int b = 0; b < BOUNDS; ++b) {
    bounds[b] = least[SAMPLED - 1] * 0.7 * pow(1.16, float(b));
    nearer[b] = 0u;
  }
  for (uint base = begin; base < end; base += BATCH) {
    load_batch(base, 1, end);
    [[unroll]] for (int i = 0; i < BATCH; ++i) {
      const float d = distance_of(base, 1, i, end, self);
      [[unroll]] for (int b = 0; b < BOUNDS; ++b) nearer[b] += d <= bounds[b] ? 1u : 0u;
    }
  }
  float bound = INFINITY;
  [[unroll]] for (int b = BOUNDS - 1; b >= 0; --b) bound = nearer[b] >= NEAREST ? bounds[b] : bound;
  return bound;
}

void main() {
  const uvec4 tile = tiles[p.first_tile + gl_WorkGroupID.x];
  const uint row = min(tile.y + gl_LocalInvocationID.x, tile.z - 1);
  const uint segment_begin = offsets[tile.x], segment_end = offsets[tile.x + 1];
  const uint begin = segment_begin + p.first_reference;
  const uint end = min(begin + p.references, segment_end);

  query0 = queries[row * VECTORS];
  query1 = VECTORS > 1 ? queries[row * VECTORS + 1] : vec4(0);
  const uint out_row = row - p.first_row;

  float nearest[NEAREST];
  uint nearest_row[NEAREST];
  float reach = INFINITY;
  if (BOUNDED) {
    const bool wanted = p.first_reference == 0 && end - begin >= 2 * NEAREST;
    const float bound = find_bound(begin, wanted ? end : begin, row);
    // Farther than the bound by more than rounding, so that who is that far finds a place.
    if (wanted) reach = bound * 1.00001 + 1e-30;
  }
  [[unroll]] for (int j = 0; j < NEAREST; ++j) {
    nearest[j] = reach;
    nearest_row[j] = segment_begin;
  }
  if (p.first_reference > 0) {
    [[unroll]] for (int j = 0; j < NEAREST; ++j) {
      const uvec2 before = found[out_row * NEAREST + j];
      nearest[j] = uintBitsToFloat(before.x);
      nearest_row[j] = before.y;
    }
  }

  uint next = begin;
  while (next < end) {
    // Subgroups that go through the batches together pass over those that none of them wants. Invocations by themselves
    // must not leave such a loop one before the other: lavapipe would give the one what it computes for the other.
    float d[BATCH];
    uint from[BATCH];
    bool wanted;
#ifdef SHUFFLE
    do
#endif
    {
      load_batch(next, 1, end);
      float least = INFINITY;
      [[unroll]] for (int i = 0; i < BATCH; ++i) {
        d[i] = distance_of(next, 1, i, end, row);
        from[i] = next + i;
        least = min(least, d[i]);
      }
      wanted = any_wants(least < nearest[NEAREST - 1]);
      next += BATCH;
    }
#ifdef SHUFFLE
    while (!wanted && next < end);
#endif

    if (wanted) {
      sort_batch(d, from);
      // The condition at the end: processors go once more through the body of a loop that begins with it, and this one
      // changes nothing where there is no candidate.
      do {
        // d[i - 1] is the one before place j, or pushes what was i places before it there.
        [[unroll]] for (int j = NEAREST - 1; j >= 0; --j) {
          float x = nearest[j];
          uint x_row = nearest_row[j];
          [[unroll]] for (int i = 1; i <= AT_ONCE && i <= j + 1; ++i) {
            const bool here = d[i - 1] < nearest[j - i + 1];
            x = here ? d[i - 1] : x;
            x_row = here ? from[i - 1] : x_row;
            if (i <= j) {
              const bool before = d[i - 1] < nearest[j - i];
              x = before ? nearest[j - i] : x;
              x_row = before ? nearest_row[j - i] : x_row;
            }
          }
          nearest[j] = x;
          nearest_row[j] = x_row;
        }
        [[unroll]] for (int i = 0; i < BATCH; ++i) {
          d[i] = i + AT_ONCE < BATCH ? d[(i + AT_ONCE) % BATCH] : INFINITY;
          from[i] = from[(i + AT_ONCE) % BATCH];
        }
      } while (d[0] < nearest[NEAREST - 1]);
    }
  }

  if (tile.y + gl_LocalInvocationID.x >= tile.z || (p.first_reference > 0 && begin >= segment_end)) return;
  if (end == segment_end) {
    [[unroll]] for (int j = 0; j < K; ++j) index[out_row * K + j] = nearest_row[(j + 1) * DILATION - 1];
  } else {
    [[unroll]] for (int j = 0; j < NEAREST; ++j)
      found[out_row * NEAREST + j] = uvec2(floatBitsToUint(nearest[j]), nearest_row[j]);
  }
}
