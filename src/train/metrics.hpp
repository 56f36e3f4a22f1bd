// The run's history: a JSON object a line, of the steps and of the validations.
#pragma once

#include <bitr/train.hpp>
#include <nlohmann/json.hpp>

#include "io/line_log.hpp"

namespace bitr::train {

/// A point of the curves.
struct Measured {
  std::size_t step = 0;
  double rotation = 0, translation = 0, spread = 0;  ///< the loss's terms
};

struct History {
  std::vector<Measured> losses;
  std::vector<ValidationResult> validations;  ///< only the medians of their errors are known
};

/// Lines go to the file as they are made. A line that a killed process left unfinished, and those of steps
/// that a resumed run does again, are dropped when it is opened.
class Metrics {
 public:
  /// Keeps what is there up to `step`; nothing for step 0. Failure (`io`).
  Metrics(const std::filesystem::path& file, std::size_t step);

  /// Failure (`io`) when they cannot be written.
  void add(const Measured& loss, const nlohmann::ordered_json& more);
  void add(const ValidationResult& validation, const nlohmann::ordered_json& more);

  const History& history() const { return history_; }

 private:
  void write(const nlohmann::ordered_json& json);
  bool remember(const nlohmann::ordered_json& json);

  History history_;
  io::LineLog log_;
};

}  // namespace bitr::train
