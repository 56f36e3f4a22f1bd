// head.comp: from a pair's features to the pieces of its pose, a work group per pair; see src/ops/head.hpp.
// in  0 positions f32[B·K,8]     xyz of both key points
// in  1 features  f32[B·K,F]     SCALARS of degree (0,0), VECTORS each of (0,1) and (1,0), MATRICES of (1,1);
//                                padded to F
// in  2 constants f32[C]         GraphNorm's weight[SCALARS], bias[SCALARS], 1 − mean scale[SCALARS]; logits'
//                                weight[3,SCALARS], bias[3]; mix of vectors[VECTORS], of matrices[MATRICES];
//                                GraphNorm's eps
// out 3 normed    f32[B·K,S4]    SCALARS, padded to S4
// out 4 logits    f32[B·K,4]     3
// out 5 weights   f32[B·K,4]     3
// out 6 pieces    f32[B,24]      21
// spec 0 WORKGROUP=128  1 SCALARS≤256  2 VECTORS≤64  3 MATRICES≤64 | grid pairs | shared 16 KiB
// loops for K ≤ 1024: ≤ 22700 < 65535 | error: see src/ops/head.hpp | fp32
#version 450
#extension GL_GOOGLE_include_directive : require
#include "common/parameters.glsl"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const uint SCALARS = 8;
layout(constant_id = 2) const uint VECTORS = 2;
layout(constant_id = 3) const uint MATRICES = 2;

const uint WORKGROUP = gl_WorkGroupSize.x;
const uint F = (SCALARS + 6 * VECTORS + 9 * MATRICES + 3) / 4 * 4;
const uint S4 = (SCALARS + 3) / 4 * 4;

// In the constants.
const uint NORM_WEIGHT = 0;
const uint NORM_BIAS = NORM_WEIGHT + SCALARS;
const uint MEAN_REST = NORM_BIAS + SCALARS;
const uint LOGIT_WEIGHT = MEAN_REST + SCALARS;
const uint LOGIT_BIAS = LOGIT_WEIGHT + 3 * SCALARS;
const uint VECTOR_MIX = LOGIT_BIAS + 3;
const uint MATRIX_MIX = VECTOR_MIX + VECTORS;
const uint EPS = MATRIX_MIX + MATRICES;

// Sums over the key points: components of (0,1), (1,0), (1,1), then positions.
const uint POOLED_10 = 3 * VECTORS;
const uint POOLED_11 = 6 * VECTORS;
const uint POOLED_POSITION = POOLED_11 + 9 * MATRICES;
const uint POOLED = POOLED_POSITION + 6;

layout(set = 0, binding = 0) readonly buffer Positions { float positions[]; };
layout(set = 0, binding = 1) readonly buffer Features { float features[]; };
layout(set = 0, binding = 2) readonly buffer Constants { float constants[]; };
layout(set = 0, binding = 3) writeonly buffer Normed { float normed[]; };
layout(set = 0, binding = 4) writeonly buffer Logits { float logits[]; };
layout(set = 0, binding = 5) writeonly buffer Weights { float weights[]; };
layout(set = 0, binding = 6) writeonly buffer Pieces { float pieces[]; };
layout(push_constant) uniform Push { HeadParameters p; };

// 3 softmaxes over the key points; from SUMS on what GraphNorm needs of every channel, later the pooled sums.
shared float numbers[4080];
shared vec2 softmax_scale[3];  // largest logit, 1 / total
const uint ORIGIN = 0, SHIFT = SCALARS, SCALE = 2 * SCALARS;

// The norm of one channel of a row, from numbers[sums + …].
float norm(uint sums, float x, uint c) {
  return (x - numbers[sums + ORIGIN + c] - numbers[sums + SHIFT + c]) * numbers[sums + SCALE + c] +
         constants[NORM_BIAS + c];
}

void main() {
  const uint lane = gl_LocalInvocationID.x, pair = p.first_pair + gl_WorkGroupID.x;
  const uint keys = p.keys, first = pair * keys, sums = 3 * keys;
  const float share = 1.0 / float(keys);

  // x is taken relative to the first key point's: equal numbers have exactly no variance. The variance is
  // that of x / spread, so that numbers of any size have one.
  for (uint c = lane; c < SCALARS; c += WORKGROUP) {
    const float origin = features[first * F + c];
    float mean = 0.0, spread = 0.0;
    for (uint k = 1; k < keys; ++k) {
      const float d = features[(first + k) * F + c] - origin;
      mean += d;
      spread = max(spread, abs(d));
    }
    mean *= share;
    const float rest = (origin + mean) * constants[MEAN_REST + c], shift = mean - rest;
    spread += abs(rest);
    float variance = 0.0;
    for (uint k = 0; k < keys; ++k) {
      const float d = spread > 0.0 ? (features[(first + k) * F + c] - origin - shift) / spread : 0.0;
      variance += d * d;
    }
    const float eps = spread > 0.0 ? constants[EPS] / spread / spread : 0.0;
    const float deviation = spread * sqrt(variance * share + eps);
    numbers[sums + ORIGIN + c] = origin;
    numbers[sums + SHIFT + c] = shift;
    numbers[sums + SCALE + c] = deviation > 0.0 ? constants[NORM_WEIGHT + c] / deviation : 0.0;
  }
  barrier();

  for (uint i = lane; i < keys * SCALARS; i += WORKGROUP) {
    const uint k = i / SCALARS, c = i % SCALARS;
    normed[(first + k) * S4 + c] = norm(sums, features[(first + k) * F + c], c);
  }
  for (uint i = lane; i < 3 * keys; i += WORKGROUP) {
    const uint k = i / 3, column = i % 3;
    float logit = 0.0;
    for (uint c = 0; c < SCALARS; ++c)
      logit += constants[LOGIT_WEIGHT + column * SCALARS + c] * norm(sums, features[(first + k) * F + c], c);
    logit += constants[LOGIT_BIAS + column];
    logits[(first + k) * 4 + column] = logit;
    numbers[i] = logit;
  }
  barrier();

  if (lane < 3) {
    float largest = numbers[lane], total = 0.0;
    for (uint k = 1; k < keys; ++k) largest = max(largest, numbers[3 * k + lane]);
    for (uint k = 0; k < keys; ++k) total += exp(numbers[3 * k + lane] - largest);
    softmax_scale[lane] = vec2(largest, 1.0 / total);
  }
  barrier();
  for (uint i = lane; i < 3 * keys; i += WORKGROUP) {
    const vec2 scale = softmax_scale[i % 3];
    const float weight = exp(numbers[i] - scale.x) * scale.y;
    weights[(first + i / 3) * 4 + i % 3] = weight;
    numbers[i] = weight;
  }
  barrier();

  for (uint i = lane; i < POOLED; i += WORKGROUP) {
    const bool position = i >= POOLED_POSITION;
    const uint column = position ? 2 : i >= POOLED_11 ? 0 : 1;
    float sum = 0.0;
    for (uint k = 0; k < keys; ++k) {
      const uint row = first + k;
      sum += numbers[3 * k + column] *
             (position ? positions[row * 8 + i - POOLED_POSITION] : features[row * F + SCALARS + i]);
    }
    numbers[sums + i] = sum;
  }
  barrier();

  for (uint i = lane; i < 21; i += WORKGROUP) {
    float piece = 0.0;
    if (i < 9) {
      // From (y, z, x) to (x, y, z) on both sides.
      const uint component = (i / 3 + 2) % 3 * 3 + (i + 2) % 3;
      for (uint c = 0; c < MATRICES; ++c)
        piece += constants[MATRIX_MIX + c] * numbers[sums + POOLED_11 + 9 * c + component];
    } else if (i < 15) {
      piece = numbers[sums + POOLED_POSITION + i - 9];
    } else {
      const uint from = (i < 18 ? POOLED_10 : 0) + (i + 2) % 3;
      for (uint c = 0; c < VECTORS; ++c) piece += constants[VECTOR_MIX + c] * numbers[sums + from + 3 * c];
    }
    pieces[pair * 24 + i] = piece;
  }
}
