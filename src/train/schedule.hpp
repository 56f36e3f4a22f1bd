// What depends on the step alone.
#pragma once

#include <bitr/train.hpp>

namespace bitr::train {

/// Learning rate of step `step`, from 0: lr · (step + 1)/warmup at first, then half a cosine from lr to
/// floor · lr at the last of `steps`.
double learning_rate(const TrainOptions& options, std::size_t step);

}  // namespace bitr::train
