// Adam on one flat vector of parameters, and the running average of what it makes.
#pragma once

#include <bitr/train.hpp>
#include <cstdint>
#include <span>
#include <vector>

namespace bitr::train {

/// Limits every entry to ± clip_value, then scales the whole to clip_norm at most; 0 switches either off.
/// Returns the norm before anything was limited; not finite if an entry is not.
double limit_gradient(std::span<double> gradient, const OptimizerOptions& options);

struct AdamState {
  std::vector<double> first, second;  ///< running means of the gradient and of its square, from zero
  std::uint64_t updates = 0;
};

/// One update with the means' bias corrected: w −= lr · m̂ / (√v̂ + eps).
void adam(std::span<double> weights, std::span<const double> gradient, AdamState& state, double lr,
          const OptimizerOptions& options);

/// Decay of the average at update n, from 0: young averages forget faster.
double average_decay(double decay, std::uint64_t n);

/// average += (1 − decay)(weights − average)
void average(std::span<double> average, std::span<const double> weights, double decay);

}  // namespace bitr::train
