#include <cmath>

#include "core/random.hpp"
#include "model/load.hpp"
#include "model/parameters.hpp"

namespace bitr::model {
namespace {

double draw(const ParameterSpec& spec, Random& random) {
  switch (spec.init) {
    case Initialisation::kaiming_uniform: {
      const double bound = std::sqrt(6 / spec.scale);
      return random.uniform(-bound, bound);
    }
    case Initialisation::bias_uniform: {
      const double bound = 1 / std::sqrt(spec.scale);
      return random.uniform(-bound, bound);
    }
    case Initialisation::normal:
      return random.normal() * spec.scale;
    case Initialisation::one:
      return 1;
    case Initialisation::zero:
      return 0;
  }
  return 0;
}

}  // namespace

Weights initial_weights(const ModelConfig& config, std::uint64_t seed, Mode mode) {
  Weights weights{.config = config,
                  .mode = mode,
                  .name = "untrained(" + std::to_string(seed) + ")",
                  .trained = false,
                  .parameters = {},
                  .metadata = {}};
  Random random(seed);
  for (const ParameterSpec& spec : state_dict(config).parameters) {
    Eigen::MatrixXd matrix(spec.shape[0], spec.shape.size() == 2 ? spec.shape[1] : 1);
    // Through float, so that a saved model is the model that was made.
    for (Eigen::Index i = 0; i < matrix.rows(); ++i)
      for (Eigen::Index j = 0; j < matrix.cols(); ++j) matrix(i, j) = static_cast<float>(draw(spec, random));
    weights.parameters.emplace(spec.name, std::move(matrix));
  }
  return weights;
}

}  // namespace bitr::model
