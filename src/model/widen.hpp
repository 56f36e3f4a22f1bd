// A wider network that says what a narrower one says: what a trained model has learnt is kept when its
// channels turn out to be too few (Net2Net: Chen, Goodfellow & Shlens, arXiv 1511.05641).
#pragma once

#include <bitr/result.hpp>

#include "model/weights.hpp"

namespace bitr::model {

/// `wide` with the function of `narrow`: `narrow`'s channels lie among the new ones, which read everything
/// and which nothing reads yet. What the new channels are at first is `wide`'s. The configurations may differ
/// in num_channels, feature_num_channels and predict_head, where `wide`'s are at least `narrow`'s;
/// `invalid_argument` names the field, its value and what it must be otherwise.
Result<Weights> widen(const Weights& narrow, Weights wide);

}  // namespace bitr::model
