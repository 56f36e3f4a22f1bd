// bitr assemble --solve: a pair by bitr::solve instead of a network.
#pragma once

#include <optional>
#include <string>

#include "cloud_input.hpp"
#include "device_choice.hpp"

namespace bitr::tool {

struct SolveRun {
  std::string source, reference, output, applied, pose, image, json;
  std::string truth;
  CloudOptions clouds;
  DeviceChoice device;
  std::optional<double> least_confidence;  ///< less is refused
};

/// Reads, solves, prints and writes; returns the exit status.
int run_solve(const SolveRun& run);

}  // namespace bitr::tool
