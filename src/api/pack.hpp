// Batches of clouds as the network reads them.
#pragma once

#include <bitr/assemble.hpp>

#include "graph/graph.hpp"

namespace bitr {

/// Clouds of a batch in the order of graph::BatchLayout, with the centroid each was moved by.
struct PackedBatch {
  graph::BatchLayout layout;
  std::vector<const CloudView*> clouds;
  std::vector<Vec3d> centroids;
  std::vector<std::vector<Vec3d>> offsets = {};  ///< per cloud, if the model reads them
};

/// Checks clouds and lays out the batch (all sources, then all references). `invalid_argument` names the
/// cloud.
Result<PackedBatch> pack(const ModelConfig& config, Precision precision, const BatchShape& capacity,
                         std::span<const CloudPair> pairs);

/// The fewest points a cloud may have.
std::size_t least_points(const ModelConfig& config);

/// Rows of a cloud's attribute, minus `shift`, `stride` numbers apart; what is between them stays.
template <class T>
void copy_rows(const Vec3View& rows, const Vec3d& shift, std::size_t stride, T* to) {
  for (std::size_t i = 0; i < rows.count; ++i, to += stride) {
    const Vec3d row = rows[i];
    for (std::size_t a = 0; a < 3; ++a) to[a] = static_cast<T>(row[a] - shift[a]);
  }
}

/// Calls fill(tensor, rows, shift, first row) for every attribute of every cloud that the graph reads.
template <class Fill>
void for_each_input(const PackedBatch& batch, const graph::Graph& graph, Fill fill) {
  for (std::size_t c = 0; c < batch.clouds.size(); ++c) {
    const CloudView& cloud = *batch.clouds[c];
    const std::size_t row = batch.layout.cloud_offset[c];
    fill(graph.positions, cloud.positions, batch.centroids[c], row);
    if (graph.normals != graph::no_tensor) fill(graph.normals, cloud.normals, Vec3d{}, row);
    if (graph.colors != graph::no_tensor) fill(graph.colors, cloud.colors, Vec3d{}, row);
    if (graph.offsets != graph::no_tensor) fill(graph.offsets, Vec3View(batch.offsets[c]), Vec3d{}, row);
  }
}

}  // namespace bitr
