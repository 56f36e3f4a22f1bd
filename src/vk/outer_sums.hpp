// Gradients of matrices: sums over rows of outer products of vectors that the rows' records hold.
#pragma once

#include "vk/kernel.hpp"

namespace bitr::vk {

/// Vectors in a record: where they begin, their size, and the step from one component's to the next one's;
/// in vec4s, but for the size.
struct RecordVectors {
  std::uint32_t at = 0, size = 0, step = 0;
};

class OuterSums {
 public:
  /// Appends a matrix to the result: Σ over rows and components of left ⊗ right. `flagged`: only of tiles
  /// with a flag in some record.
  void add(const RecordVectors& left, const RecordVectors& right, std::uint32_t components,
           bool row_major = false, bool flagged = false);
  bool empty() const { return jobs_.empty(); }

  const std::vector<std::uint32_t>& jobs() const { return jobs_; }
  /// Padded so that a row of the result ends with them.
  std::vector<std::uint32_t> places() const;
  /// Where the first matrix begins in a result that others begin.
  void begin_at(std::uint32_t begin) { begin_ = begin; }

  /// `record`: vec4s of one; `flag`: where its flag is. `segmented`: a row per segment, not one for all.
  void make_pipelines(const Context& context, std::uint32_t record, std::uint32_t flag, bool segmented);
  std::size_t partial_bytes(const graph::BatchLayout& layout, graph::Rows rows) const;
  struct Memory {
    Range jobs, places;  ///< this class's numbers on the device
    Range partials;
  };
  /// Sums over tiles [first, first + count), whose records are bound from `first_row` on.
  void record_sums(const Arguments& args, const Memory& memory, const Range& records, const RowTable& table,
                   std::uint32_t first, std::uint32_t count, std::uint32_t first_row) const;
  /// Totals over all tiles, after their sums.
  void record_totals(const Arguments& args, const Memory& memory, const RowTable& table,
                     std::uint32_t segments, const Range& result) const;

 private:
  std::uint32_t job_count() const { return static_cast<std::uint32_t>(jobs_.size() / 4); }
  std::vector<std::uint32_t> jobs_, places_;
  const Capabilities* capabilities_ = nullptr;
  bool segmented_ = false;
  std::uint32_t begin_ = 0;
  PipelineOf<OuterParameters> sums_;
  PipelineOf<OuterTotalParameters> totals_;
};

}  // namespace bitr::vk
