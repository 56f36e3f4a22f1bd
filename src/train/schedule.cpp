#include "train/schedule.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace bitr::train {

double learning_rate(const TrainOptions& options, std::size_t step) {
  const auto& [warmup, floor] = options.schedule;
  const double lr = options.optimizer.lr;
  if (step < warmup) return lr * static_cast<double>(step + 1) / static_cast<double>(warmup);
  const double length = static_cast<double>(std::max(options.steps, warmup + 2) - warmup - 1);
  const double way = std::min(static_cast<double>(step - warmup) / length, 1.0);
  return lr * (floor + (1 - floor) * (1 + std::cos(std::numbers::pi * way)) / 2);
}

}  // namespace bitr::train
