// How good weights are on samples that stay the same for a whole run.
#pragma once

#include <bitr/train.hpp>

#include "model/weights.hpp"

namespace bitr::train {

class Validator {
 public:
  /// Draws the samples. Failure when a part of the data cannot be used.
  Validator(const Device& device, const TrainOptions& options);

  /// A pose that is not finite counts as 180°.
  ValidationResult run(const model::Weights& weights, std::size_t step) const;

 private:
  struct Group {
    std::string name;
    std::vector<DataSample> samples;
  };

  Device device_;
  std::size_t batch_;
  std::vector<Group> groups_;
};

}  // namespace bitr::train
