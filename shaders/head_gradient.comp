// head_gradient.comp: of a pair's pieces with respect to its key points, their features and the head's constants, a work
// group per pair; see src/ops/head.hpp.
// in  0 positions   f32[B·K,8]  xyz of both key points
// in  1 features    f32[B·K,F]  SCALARS of degree (0,0), VECTORS each of (0,1) and (1,0), MATRICES of (1,1); padded to F
// in  2 weights     f32[B·K,4]  3 softmaxes
// in  3 d_pieces    f32[B,24]   21
// in  4 constants   f32[C]      as in head.comp
// out 5 d_positions f32[B·K,8]  if POSITIONS
// out 6 d_features  f32[B·K,F]  if FEATURES
// out 7 d_constants f32[B,D]    of each pair: GraphNorm's weight[SCALARS], bias[SCALARS], mean scale[SCALARS]; logits'
//                               weight[SCALARS,3], bias[3]; mix of vectors[VECTORS], of matrices[MATRICES]; padded to D
// spec 0 WORKGROUP=128  1 SCALARS≤256  2 VECTORS≤64  3 MATRICES≤64  4 POSITIONS  5 FEATURES | grid pairs | shared 16 KiB
// loops for K ≤ 1024: ≤ 54000 < 65535 | error: see src/ops/gradient.hpp | fp32
#version 450
#extension GL_GOOGLE_include_directive : require
#include "common/parameters.glsl"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const uint SCALARS = 8;
layout(constant_id = 2) const uint VECTORS = 2;
layout(constant_id = 3) const uint MATRICES = 2;
layout(constant_id = 4) const bool POSITIONS = true;
layout(constant_id = 5) const bool FEATURES = true;

const uint WORKGROUP = gl_WorkGroupSize.x;
const uint F = (SCALARS + 6 * VECTORS + 9 * MATRICES + 3) / 4 * 4;

// In the constants.
const uint NORM_WEIGHT = 0;
const uint NORM_BIAS = NORM_WEIGHT + SCALARS;
const uint MEAN_REST = NORM_BIAS + SCALARS;
const uint LOGIT_WEIGHT = MEAN_REST + SCALARS;
const uint LOGIT_BIAS = LOGIT_WEIGHT + 3 * SCALARS;
const uint VECTOR_MIX = LOGIT_BIAS + 3;
const uint MATRIX_MIX = VECTOR_MIX + VECTORS;
const uint EPS = MATRIX_MIX + MATRICES;
const uint D = (EPS + 3) / 4 * 4;

// Where degrees begin in a row of features.
const uint SECOND = SCALARS, FIRST = SCALARS + 3 * VECTORS, BOTH = SCALARS + 6 * VECTORS;

layout(set = 0, binding = 0) readonly buffer Positions { float positions[]; };
layout(set = 0, binding = 1) readonly buffer Features { float features[]; };
layout(set = 0, binding = 2) readonly buffer Weights { float weights[]; };
layout(set = 0, binding = 3) readonly buffer PieceGradient { float d_pieces[]; };
layout(set = 0, binding = 4) readonly buffer Constants { float constants[]; };
layout(set = 0, binding = 5) writeonly buffer PositionGradient { float d_positions[]; };
layout(set = 0, binding = 6) writeonly buffer FeatureGradient { float d_features[]; };
layout(set = 0, binding = 7) writeonly buffer ConstantGradient { float d_constants[]; };
layout(push_constant) uniform Push { HeadParameters p; };

// Gradients of 3 softmaxes over the key points, later of their logits; from SUMS on GraphNorm's numbers of every
// channel.
shared float numbers[4064];
shared float piece[21];
shared float average[3];
const uint ORIGIN = 0, SHIFT = SCALARS, SCALE = 2 * SCALARS, MEAN = 3 * SCALARS;

// The gradient of a component of degree 1, or of (1,1), in the features' order (y, z, x).
float vector_piece(uint from, uint i) { return piece[from + (i + 1) % 3]; }
float matrix_piece(uint i) { return piece[3 * ((i / 3 + 1) % 3) + (i + 1) % 3]; }

// The gradient of a number of the features behind the scalars, but for its key point's weight.
float feature_piece(uint column) {
  if (column < FIRST) return constants[VECTOR_MIX + (column - SECOND) / 3] * vector_piece(18, (column - SECOND) % 3);
  if (column < BOTH) return constants[VECTOR_MIX + (column - FIRST) / 3] * vector_piece(15, (column - FIRST) % 3);
  return constants[MATRIX_MIX + (column - BOTH) / 9] * matrix_piece((column - BOTH) % 9);
}

void main() {
  const uint lane = gl_LocalInvocationID.x, pair = p.first_pair + gl_WorkGroupID.x;
  const uint keys = p.keys, first = pair * keys, sums = 3 * keys;
  const float share = 1.0 / float(keys);

  if (lane < 21) piece[lane] = d_pieces[pair * 24 + lane];
  // As in head.comp; x is taken relative to the first key point's.
  for (uint c = lane; c < SCALARS; c += WORKGROUP) {
    const float origin = features[first * F + c];
    float middle = 0.0, spread = 0.0;
    for (uint k = 1; k < keys; ++k) {
      const float d = features[(first + k) * F + c] - origin;
      middle += d;
      spread = max(spread, abs(d));
    }
    middle *= share;
    const float rest = (origin + middle) * constants[MEAN_REST + c], shift = middle - rest;
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
    numbers[sums + SCALE + c] = deviation > 0.0 ? 1.0 / deviation : 0.0;
    numbers[sums + MEAN + c] = origin + middle;
  }
  barrier();

  for (uint i = lane; i < 3 * keys; i += WORKGROUP) {
    const uint row = first + i / 3, column = i % 3;
    float sum = 0.0;
    if (column == 2) {
      for (uint a = 0; a < 6; ++a) sum += positions[row * 8 + a] * piece[9 + a];
    } else {
      const uint begin = column == 0 ? BOTH : SECOND, end = column == 0 ? BOTH + 9 * MATRICES : BOTH;
      for (uint j = begin; j < end; ++j) sum += features[row * F + j] * feature_piece(j);
    }
    numbers[i] = sum;
  }
  barrier();
  if (lane < 3) {
    float sum = 0.0;
    for (uint k = 0; k < keys; ++k) sum += weights[(first + k) * 4 + lane] * numbers[3 * k + lane];
    average[lane] = sum;
  }
  barrier();
  for (uint i = lane; i < 3 * keys; i += WORKGROUP)
    numbers[i] = weights[(first + i / 3) * 4 + i % 3] * (numbers[i] - average[i % 3]);
  barrier();

  const uint to = pair * D;
  for (uint c = lane; c < SCALARS; c += WORKGROUP) {
    const float center = numbers[sums + ORIGIN + c] + numbers[sums + SHIFT + c];
    const float scale = numbers[sums + SCALE + c], weight = constants[NORM_WEIGHT + c];
    const vec3 from = vec3(constants[LOGIT_WEIGHT + c], constants[LOGIT_WEIGHT + SCALARS + c],
                           constants[LOGIT_WEIGHT + 2 * SCALARS + c]);
    // The gradient of the normed x summed over key points, and its product with x before gain and bias.
    float total = 0.0, along = 0.0, normed = 0.0;
    vec3 by_logit = vec3(0);
    for (uint k = 0; k < keys; ++k) {
      const vec3 logits = vec3(numbers[3 * k], numbers[3 * k + 1], numbers[3 * k + 2]);
      const float x = (features[(first + k) * F + c] - center) * scale, d = dot(logits, from);
      total += d;
      along += d * x;
      normed += x;
      by_logit += logits * (x * weight + constants[NORM_BIAS + c]);
    }
    // The gradient of x less the mean's part, summed over key points.
    const float all = weight * scale * (total - along * share * normed);
    const float rest = constants[MEAN_REST + c];
    d_constants[to + NORM_WEIGHT + c] = along;
    d_constants[to + NORM_BIAS + c] = total;
    d_constants[to + MEAN_REST + c] = -all * numbers[sums + MEAN + c];
    for (uint j = 0; j < 3; ++j) d_constants[to + LOGIT_WEIGHT + 3 * c + j] = by_logit[j];
    if (FEATURES) {
      const float back = all * (1.0 - rest) * share;
      for (uint k = 0; k < keys; ++k) {
        const vec3 logits = vec3(numbers[3 * k], numbers[3 * k + 1], numbers[3 * k + 2]);
        const float x = (features[(first + k) * F + c] - center) * scale;
        d_features[(first + k) * F + c] = weight * scale * (dot(logits, from) - x * along * share) - back;
      }
    }
  }

  for (uint i = lane; i < 3 + VECTORS + MATRICES; i += WORKGROUP) {
    float sum = 0.0;
    if (i < 3) {
      for (uint k = 0; k < keys; ++k) sum += numbers[3 * k + i];
    } else if (i < 3 + VECTORS) {
      const uint from = 3 * (i - 3);
      for (uint k = 0; k < keys; ++k) {
        const uint at = (first + k) * F + from;
        float product = 0.0;
        for (uint a = 0; a < 3; ++a)
          product += features[at + SECOND + a] * vector_piece(18, a) + features[at + FIRST + a] * vector_piece(15, a);
        sum += product * weights[(first + k) * 4 + 1];
      }
    } else {
      const uint from = BOTH + 9 * (i - 3 - VECTORS);
      for (uint k = 0; k < keys; ++k) {
        float product = 0.0;
        for (uint a = 0; a < 9; ++a) product += features[(first + k) * F + from + a] * matrix_piece(a);
        sum += product * weights[(first + k) * 4];
      }
    }
    d_constants[to + LOGIT_BIAS + i] = sum;
  }
  for (uint i = EPS + lane; i < D; i += WORKGROUP) d_constants[to + i] = 0.0;

  if (FEATURES) {
    const uint rest = F - SCALARS;
    for (uint i = lane; i < keys * rest; i += WORKGROUP) {
      const uint row = first + i / rest, column = SCALARS + i % rest;
      float x = 0.0;
      if (column < BOTH + 9 * MATRICES) x = weights[row * 4 + (column < BOTH ? 1 : 0)] * feature_piece(column);
      d_features[row * F + column] = x;
    }
  }
  if (POSITIONS)
    for (uint i = lane; i < 8 * keys; i += WORKGROUP)
      d_positions[first * 8 + i] = i % 8 < 6 ? weights[(first + i / 8) * 4 + 2] * piece[9 + i % 8] : 0.0;
}
