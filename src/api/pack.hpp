// Batches of clouds as the network reads them.
#pragma once

#include <algorithm>
#include <bitr/assemble.hpp>
#include <optional>
#include <span>

#include "graph/executor.hpp"

namespace bitr {

/// Clouds of a batch in the order of graph::BatchLayout, with the centroid each was moved by.
struct PackedBatch {
  graph::BatchLayout layout;
  std::vector<const CloudView*> clouds;
  std::vector<Vec3d> centroids;
  /// Per cloud, its points as the network gets them: along a curve, where neighbours are near each other in
  /// memory, so that the same points give the same bits in whatever order they come.
  std::vector<std::vector<std::uint32_t>> order = {};
  std::vector<std::vector<Vec3d>> offsets = {};  ///< per cloud, if the model reads them
};

/// Checks clouds and lays out the batch (all sources, then all references). `invalid_argument` names the
/// cloud.
Result<PackedBatch> pack(const ModelConfig& config, Precision precision, const BatchShape& capacity,
                         std::span<const CloudPair> pairs);

/// The fewest points a cloud may have.
std::size_t least_points(const ModelConfig& config);

/// Rows of a cloud's attribute in `order`, minus `shift`, `stride` numbers apart, zeros between them.
template <class T>
void copy_rows(const Vec3View& rows, std::span<const std::uint32_t> order, const Vec3d& shift,
               std::size_t stride, T* to) {
  for (const std::uint32_t i : order) {
    const Vec3d row = rows[i];
    for (std::size_t a = 0; a < 3; ++a) to[a] = static_cast<T>(row[a] - shift[a]);
    std::fill(to + 3, to + stride, T{0});
    to += stride;
  }
}

/// A cloud's rows for one of the graph's inputs, to be written minus `shift`.
struct InputRows {
  Vec3View rows;
  Vec3d shift = {};
};

/// nullopt for an input that clouds do not have.
std::optional<InputRows> input_rows(const PackedBatch& batch, std::size_t cloud, graph::Input role);

/// Writes every input that clouds have into an executor prepared for the batch.
inline void fill_inputs(const PackedBatch& batch, graph::Executor& executor) {
  for (const auto& [role, id] : executor.graph().inputs) {
    const graph::TensorView to = executor.input(id);
    for (std::size_t c = 0; c < batch.clouds.size(); ++c)
      if (const auto from = input_rows(batch, c, role))
        to.visit([&](auto* rows) {
          copy_rows(from->rows, batch.order[c], from->shift, to.stride,
                    rows + to.stride * batch.layout.cloud_offset[c]);
        });
  }
}

}  // namespace bitr
