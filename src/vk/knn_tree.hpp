// Neighbours within large clouds: a tree of boxes, built anew for every batch (shaders/common/knn_tree.glsl).
#pragma once

#include "vk/kernel.hpp"

namespace bitr::vk {

class KnnTree {
 public:
  KnnTree(const Context& context, int k, int dilation);

  static std::size_t scratch_bytes(const graph::BatchLayout& layout, const Capabilities& capabilities);
  /// Neighbours of every point of `points` in its cloud.
  void record(Schedule& schedule, const graph::BatchLayout& layout, const RowTable& table, const Slot& points,
              const Slot& index, const Range& scratch) const;

 private:
  const Capabilities& capabilities_;
  PipelineOf<NoParameters> bounds_, scan_, levels_;
  PipelineOf<TileParameters> clear_, count_, scatter_, blocks_;
  PipelineOf<PointParameters> search_;
};

}  // namespace bitr::vk
