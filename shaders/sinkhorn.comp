// sinkhorn.comp: half an iteration of Sinkhorn's: the potentials of one side that make its rows of the plan sum to 1
// with their slack; see src/vk/sinkhorn.hpp. With CHANGES, on the sources' side, also how much the last iteration
// changed the plan. An invocation takes a row, a work group a block of 64 neighbours, which looks at the other side's
// blocks that can matter to it.
// in  0 points     f32[P,4·(1+NORMALS)] xyz, normal; in kernel widths; a cloud begins at a multiple of 64
// in  1 boxes      f32[P/64,8]  low corner, 0, high corner, 0
// in  2 tiles      u32[tiles,4] plan, first row, row past the last, 0
// in  3 plans      u32[plans,8] sources' first row, past the last, references' first row, past the last, slack
//                               (coarse, rest), tolerance, 0
// mod 4 potentials f32[2P,4]    coarse, rest, last change, –; sources' of even and odd iterations, from row 0 and P on
// mod 5 blocks     f32[P/64,4]  largest potential, largest |last change|, Σ |change of the plan|, –
// in  6 states     u32[plans,4] whether it has stopped, after which iteration, –, –
// spec 0 WORKGROUP=64  1 NORMALS  2 CHANGES | grid tiles | shared 1.5 KiB
// loops ≤ 10·P/64 + 200 with ≤ 400000 points of a cloud ≤ 62700 < 65535 | error: 1e-6 of a potential's change | fp32
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
layout(constant_id = 2) const bool CHANGES = true;  // whether the plan's changes are wanted

layout(set = 0, binding = 0) readonly buffer Points { vec4 points[]; };
layout(set = 0, binding = 1) readonly buffer Boxes { vec4 boxes[]; };
layout(set = 0, binding = 2) readonly buffer Tiles { uvec4 tiles[]; };
layout(set = 0, binding = 3) readonly buffer Plans { uvec4 plans[]; };
layout(set = 0, binding = 4) buffer Potentials { vec4 potentials[]; };
layout(set = 0, binding = 5) buffer Blocks { vec4 blocks[]; };
layout(set = 0, binding = 6) readonly buffer States { uvec4 states[]; };
layout(push_constant) uniform Push { SinkhornParameters p; };

#include "common/transport_plan.glsl"

shared float shared_bound[64];
shared uint shared_block[64];
shared vec4 shared_totals[64];

// |exp(x) − 1| keeps its digits near 0; where a potential changed by more than 1 nobody asks (sinkhorn_stop.comp).
float change_by(float x) {
  const float y = clamp(x, -1.0, 1.0);
  const float higher = 1.0 / 24.0 + y * (1.0 / 120.0 + y * (1.0 / 720.0 + y * (1.0 / 5040.0)));
  return abs(y + y * y * (0.5 + y * (1.0 / 6.0 + y * higher)));
}

// log of 1/√2 … √2, to single precision.
float log_near_one(float x) {
  const float s = (x - 1.0) / (x + 1.0), q = s * s;
  return 2.0 * s * (1.0 + q * (1.0 / 3.0 + q * (0.2 + q * (1.0 / 7.0 + q * (1.0 / 9.0 + q / 11.0)))));
}

// Sums relative to e^most: of the plan's terms, and of their changes.
struct Sums {
  float most, total, changed;
};

void add_block(inout Sums sums, vec3 position, vec3 normal, float own_change, uint first, uint end,
               uint potentials_from) {
  for (uint base = first; base < end; base += BATCH) {
    const Loaded loaded = load_batch(base, end, potentials_from);
    Term terms[BATCH];
    float most = sums.most;
    [[unroll]] for (int i = 0; i < BATCH; ++i) {
      terms[i] = term_of(position, normal, loaded, base, end, potentials_from, i);
      most = max(most, terms[i].coarse);
    }
    const float scale = exp(sums.most - most);
    sums.total *= scale;
    sums.changed *= scale;
    sums.most = most;
    [[unroll]] for (int i = 0; i < BATCH; ++i) {
      const float part = exp(terms[i].coarse - most + terms[i].rest);
      sums.total += part;
      if (CHANGES) sums.changed += part * change_by(-own_change - terms[i].change);
    }
  }
}

void main() {
  const uint lane = gl_LocalInvocationID.x;
  const uvec4 tile = tiles[p.first + gl_WorkGroupID.x];
  const uint row = min(tile.y + lane, tile.z - 1);
  const bool mine = tile.y + lane < tile.z;
  const uvec4 rows = plans[2 * tile.x], numbers = plans[2 * tile.x + 1];
  const bool going = states[tile.x].x == 0;
  const bool of_source = tile.y < rows.z;
  const uint begin = of_source ? rows.z : rows.x, end = going ? (of_source ? rows.w : rows.y) : begin;
  const uint this_parity = (p.iteration & 1u) * p.rows;
  const uint potentials_from = of_source ? 0 : this_parity;
  const uint before_at = row + (of_source ? p.rows - this_parity : 0);
  const vec4 before = potentials[before_at];

  const vec3 position = points[row * WIDTH].xyz, normal = NORMALS ? points[row * WIDTH + 1].xyz : vec3(0);
  const uint own_block = tile.y / BLOCK, first_block = begin / BLOCK, blocks_end = (end + BLOCK - 1) / BLOCK;
  const vec3 low = boxes[2 * own_block].xyz, high = boxes[2 * own_block + 1].xyz;

  // The most promising block first: it shows which others cannot matter.
  float best = -INFINITY_BOUND;
  uint best_block = first_block;
  for (uint b = first_block + lane; b < blocks_end; b += BLOCK) {
    const float bound = blocks[b].x - squared_gap(low, high, boxes[2 * b].xyz, boxes[2 * b + 1].xyz);
    if (bound > best) {
      best = bound;
      best_block = b;
    }
  }
  shared_bound[lane] = best;
  shared_block[lane] = best_block;
  barrier();
  for (uint i = 0; i < BLOCK && going; ++i)
    if (shared_bound[i] > best || (shared_bound[i] == best && shared_block[i] < best_block)) {
      best = shared_bound[i];
      best_block = shared_block[i];
    }
  barrier();

  Sums sums = Sums(-uintBitsToFloat(numbers.x), exp(-uintBitsToFloat(numbers.y)), 0.0);
  if (going)
    add_block(sums, position, normal, before.z, max(best_block * BLOCK, begin), min((best_block + 1) * BLOCK, end),
              potentials_from);
  shared_bound[lane] = sums.most;
  barrier();
  float least = sums.most;
  for (uint i = 0; i < BLOCK && going; ++i) least = min(least, shared_bound[i]);
  least -= NEGLIGIBLE;
  barrier();

  for (uint chunk = first_block; chunk < blocks_end; chunk += BLOCK) {
    const uint b = min(chunk + lane, blocks_end - 1);
    shared_bound[lane] = blocks[b].x - squared_gap(low, high, boxes[2 * b].xyz, boxes[2 * b + 1].xyz);
    barrier();
    const uint count = min(BLOCK, blocks_end - chunk);
    for (uint i = 0; i < count; ++i)
      if (shared_bound[i] >= least && chunk + i != best_block)
        add_block(sums, position, normal, before.z, (chunk + i) * BLOCK, min((chunk + i + 1) * BLOCK, end),
                  potentials_from);
    barrier();
  }

  // −log(total · e^most), of which the exponent's part is coarse.
  const uint bits = floatBitsToUint(sums.total);
  int exponent = int(bits >> 23) - 127;
  float mantissa = uintBitsToFloat((bits & 0x7fffffu) | 0x3f800000u);
  if (mantissa > 1.41421356) {
    mantissa *= 0.5;
    ++exponent;
  }
  float coarse = -(sums.most + float(exponent) * (709.0 / 1024.0));
  float rest = -(float(exponent) * 7.64368060e-4 + log_near_one(mantissa));
  const float carry = round(rest * 1024.0) * (1.0 / 1024.0);
  coarse += carry;
  rest -= carry;
  const float change = (coarse - before.x) + (rest - before.y);
  if (mine && going) potentials[row + (of_source ? this_parity : 0)] = vec4(coarse, rest, change, 0);

  // What the last iteration changed is known of the sources now, of the references since it ended.
  const float changed = sums.changed * exp(sums.most + before.x + before.y);
  shared_totals[lane] =
      mine ? vec4(coarse + rest, abs(of_source ? before.z : change), changed, 0) : vec4(-INFINITY_BOUND, 0, 0, 0);
  barrier();
  for (uint half_size = BLOCK / 2; half_size > 0; half_size /= 2) {
    if (lane < half_size) {
      const vec4 a = shared_totals[lane], b = shared_totals[lane + half_size];
      shared_totals[lane] = vec4(max(a.xy, b.xy), a.z + b.z, 0);
    }
    barrier();
  }
  if (lane == 0 && going) blocks[own_block] = shared_totals[0];
}
