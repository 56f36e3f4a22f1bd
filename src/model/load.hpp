// From named tensors to a model's weights, and back.
#pragma once

#include <bitr/result.hpp>
#include <string>

#include "core/tensor.hpp"
#include "model/weights.hpp"

namespace bitr::model {

/// Checks every name and shape against the state dict of the configuration. `bad_file` names the tensor.
Result<Weights> weights_from_tensors(const TensorMap& map, const ModelOptions& options);

/// Canonical names, with configuration and mode in the metadata.
TensorMap tensors_from_weights(const Weights& weights, WeightPrecision precision = WeightPrecision::f32);

/// The official initialisation from a seed.
Weights initial_weights(const ModelConfig& config, std::uint64_t seed, Mode mode);

}  // namespace bitr::model
