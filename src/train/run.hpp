// A whole run: steps, validations, and the files that are written on the way.
#pragma once

#include <bitr/train.hpp>
#include <functional>
#include <memory>

#include "train/differentiator.hpp"

namespace bitr::train {

using MakeDifferentiator = std::function<std::unique_ptr<Differentiator>(const model::Weights&)>;

/// As bitr::train_model; errors come as Failure.
TrainSummary run(const Device& device, TrainOptions options, const TrainFiles& files, bool resume,
                 const TrainCallbacks& callbacks, const MakeDifferentiator& make);

}  // namespace bitr::train
