#include "train/optimizer.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

namespace bitr::train {

double limit_gradient(std::span<double> gradient, const OptimizerOptions& options) {
  Eigen::Map<Eigen::ArrayXd> g(gradient.data(), static_cast<Eigen::Index>(gradient.size()));
  const double before = std::sqrt(g.square().sum());
  double norm = before;
  if (options.clip_value > 0) {
    g = g.min(options.clip_value).max(-options.clip_value);
    norm = std::sqrt(g.square().sum());
  }
  if (options.clip_norm > 0 && norm > options.clip_norm) g *= options.clip_norm / norm;
  return before;
}

void adam(std::span<double> weights, std::span<const double> gradient, AdamState& state, double lr,
          const OptimizerOptions& options) {
  state.first.resize(weights.size());
  state.second.resize(weights.size());
  const auto n = static_cast<double>(++state.updates);
  const double first_scale = 1 / (1 - std::pow(options.beta1, n));
  const double second_scale = 1 / (1 - std::pow(options.beta2, n));
  for (std::size_t i = 0; i < weights.size(); ++i) {
    double &m = state.first[i], &v = state.second[i];
    m = options.beta1 * m + (1 - options.beta1) * gradient[i];
    v = options.beta2 * v + (1 - options.beta2) * gradient[i] * gradient[i];
    weights[i] -= lr * (m * first_scale) / (std::sqrt(v * second_scale) + options.eps);
  }
}

double average_decay(double decay, std::uint64_t n) {
  const auto x = static_cast<double>(n);
  return std::min(decay, (1 + x) / (10 + x));
}

void average(std::span<double> average, std::span<const double> weights, double decay) {
  for (std::size_t i = 0; i < average.size(); ++i) average[i] += (1 - decay) * (weights[i] - average[i]);
}

}  // namespace bitr::train
