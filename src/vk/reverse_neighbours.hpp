// Edges by the row they come from, for sums over them in a fixed order.
#pragma once

#include "vk/kernel.hpp"

namespace bitr::vk {

/// For each row of the neighbours, the edges (row · k + j) that come from it, ascending.
struct EdgeLists {
  Range begins, counts, list;
};

class ReverseNeighbours {
 public:
  ReverseNeighbours(const Context& context, int k);

  /// Bytes for an index tensor with k neighbours of each of `rows` rows among `neighbours` others.
  std::size_t bytes(std::size_t rows, std::size_t neighbors) const;
  /// The lists in `args.lists`, which it makes if they are to be. `rows`: what the index tensor has a row of.
  EdgeLists record(const Arguments& args, const Slot& index, graph::Rows rows, graph::Rows neighbors) const;

 private:
  const Capabilities& capabilities_;
  std::uint32_t k_;
  PipelineOf<EdgeParameters> clear_, count_;
  PipelineOf<SegmentParameters> scan_;
  PipelineOf<EdgeParameters> fill_, sort_;
};

/// Adds up what the edges from each row send, behind what the row's record holds.
class EdgeGather {
 public:
  struct Shape {
    std::uint32_t width = 4;            ///< numbers of a row, a multiple of 4
    std::uint32_t record = 1, own = 0;  ///< vec4s of a record; where the row's part begins in it
    bool has_own = true, has_edges = true;
    std::uint32_t edge = 1, at = 0;  ///< vec4s of an edge; where the row's part begins in it
    std::uint32_t both_ends = 0;     ///< not 0: edges of a row, whose part counts for it, not against it
  };
  /// What of a kernel's memory a run of tiles meets.
  struct Run {
    std::uint32_t first_tile, tiles;
    std::uint32_t first_row;   ///< where `record` begins
    std::uint32_t first_edge;  ///< where `edges` begins
  };
  EdgeGather(const Context& context, const Shape& shape);

  void record(const Arguments& args, const Run& run, const EdgeLists& lists, const Range& edges,
              const Range& record, const RowTable& table, const Range& result) const;

 private:
  Shape shape_;
  PipelineOf<GatherParameters> pipeline_;
};

}  // namespace bitr::vk
