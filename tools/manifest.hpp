// The pairs of a batch: a CSV table or JSON lines.
#pragma once

#include <bitr/pose.hpp>
#include <bitr/result.hpp>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

namespace bitr::tool {

/// Paths are relative to the manifest's folder in the file, and not any more here.
struct ManifestEntry {
  std::uint64_t number = 0;  ///< the pair's, from 0
  std::string name;          ///< as given, else made from the number
  std::string source, reference;
  std::string truth;         ///< a file with the true pose; empty: none
  std::optional<Pose> pose;  ///< the true pose where it stands in the manifest itself
};

/// Read line by line, so that its length does not matter; a line may have a mebibyte. A table's first line names its columns: source,
/// reference and, where they are wanted, truth and name; others are ignored. JSON lines (*.jsonl, *.ndjson,
/// *.json) are objects with the same keys; "T_reference_source", a 4×4 matrix, may take the place of "truth".
class Manifest {
 public:
  class Lines;
  /// `bad_file`, `not_found` or `io`, naming the file.
  static Result<Manifest> open(const std::string& path);
  Manifest(Manifest&&) noexcept;
  Manifest& operator=(Manifest&&) noexcept;
  ~Manifest();

  /// The next pair, nothing after the last, or `bad_file` with file and line: the pair after it comes next.
  /// `io` when the file cannot be read any further.
  Result<std::optional<ManifestEntry>> next();

 private:
  explicit Manifest(std::unique_ptr<Lines> lines);
  std::unique_ptr<Lines> lines_;
};

/// How many pairs there are, and a number that changes with any of the file's bytes.
struct ManifestSummary {
  std::uint64_t pairs = 0, fingerprint = 0;
};
/// `check` is given every pair in turn, and its error ends it. Errors as of Manifest::open; `io` too when the
/// file is one that can be read once only, as a pipe is.
Result<ManifestSummary> summarise_manifest(
    const std::string& path, const std::function<Result<void>(const ManifestEntry&)>& check = {});

}  // namespace bitr::tool
