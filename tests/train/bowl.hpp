// Losses that need no network: every weight is drawn towards a number that depends on the pairs.
#pragma once

#include <functional>
#include <limits>

#include "core/failure.hpp"
#include "train/trainer.hpp"

namespace bitr::test {

class Bowl : public train::Differentiator {
 public:
  int evaluations = 0;
  std::function<bool(int)> poisoned = [](int) { return false; };  ///< gives a NaN at this evaluation, from 1
  std::function<bool(int)> refused = [](int) { return false; };

  train::LossTerms evaluate(const model::Weights& weights, std::span<const train::TrainingPair> pairs,
                            train::Gradients& gradients) override {
    ++evaluations;
    if (refused(evaluations)) throw Failure(ErrorCode::invalid_argument, "all points are equal");
    double target = 0;
    for (const train::TrainingPair& pair : pairs)
      target += pair.T_reference_source.rotation[0] / static_cast<double>(pairs.size());
    train::LossTerms loss;
    gradients.clear();
    for (const auto& [name, matrix] : weights.parameters) {
      const Eigen::MatrixXd difference = matrix.array() - target;
      loss.rotation += difference.squaredNorm();
      gradients[name] = 2 * difference;
    }
    if (poisoned(evaluations)) gradients.begin()->second(0, 0) = std::numeric_limits<double>::quiet_NaN();
    return loss;
  }
};

/// A small network and small clouds.
inline TrainOptions small_options() {
  TrainOptions options;
  options.model = {};
  options.model.feature_num_layers = 1;
  options.model.num_layers = 0;
  options.model.k_neighbor = 8;
  options.model.key_mean_num = 8;
  options.model.num_key_points = 8;
  options.model.re_convert_k = 4;
  options.data.normals = false;
  options.data.parts = {{.kind = "copy", .shapes = 40}};
  options.data.points_low = 40;
  options.data.points_high = 60;
  options.steps = 20;
  options.batch = 2;
  options.validation.every = 0;
  return options;
}

}  // namespace bitr::test
