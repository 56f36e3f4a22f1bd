// The result of one pair, as text and as JSON.
#pragma once

#include <bitr/assemble.hpp>
#include <cstdio>
#include <optional>
#include <vector>

#include "answer.hpp"
#include "output.hpp"

namespace bitr::tool {

struct AssemblyReport {
  Answer answer;
  const Plan* plan = nullptr;  ///< of the network that was named; null where solve() was asked
  const Device* device = nullptr;
  bool complete_match = false;
  std::size_t source_points = 0, reference_points = 0;  ///< that were looked at
  std::vector<StageTime> timings;
  double total_milliseconds = 0;  ///< from reading the files to the pose
  std::optional<Pose> truth = {};
  RefineOptions refine_options = {};  ///< those the refinement had
  std::vector<StageDifference> verification = {};
};

bool within_bounds(const AssemblyReport& report);

/// Pose, diagnostics, confidence and, where they were asked for, the errors and the verification's table.
void print(const AssemblyReport& report, std::FILE* out);

/// The pose's status, and the signals that tell good from bad.
Json diagnostics_json(const Answer& answer);
std::string_view status_name(Status status);

/// Everything but `timing_ms` is the same in every run.
Json to_json(const AssemblyReport& report);

}  // namespace bitr::tool
