// Everything a run needs to go on as if it had never stopped, as one safetensors file.
#pragma once

#include <optional>

#include "train/optimizer.hpp"

namespace bitr::train {

struct TrainState {
  std::vector<double> weights;  ///< flat (flat.hpp)
  AdamState adam;
  std::vector<double> average;
  std::uint64_t step = 0;  ///< steps done, skipped ones included
  std::uint64_t skipped_steps = 0, skipped_in_row = 0, skipped_samples = 0;
  DataPosition position;  ///< where the next sample is: with the seed, all there is of random numbers
  std::optional<double> best_score;
  std::uint64_t best_step = 0, validations_since_best = 0;
  double seconds = 0;  ///< spent training, over all processes
};

struct Checkpoint {
  TrainOptions options;
  TrainState state;
};

std::vector<std::byte> serialize(const Checkpoint& checkpoint);

/// `bad_file` names what is missing, misshapen or not finite.
Result<Checkpoint> parse_checkpoint(std::span<const std::byte> bytes, const std::string& file);

}  // namespace bitr::train
