// The fold's algebra backwards: from the gradient of a folded layer's constants to that of the layer's own
// (model/fold_layers.hpp). A gradient lives in an operation of the same shape; all functions add to `to`.
#pragma once

#include "core/for_each.hpp"
#include "ops/attention_layer.hpp"
#include "ops/pair_attention.hpp"
#include "ops/point_attention.hpp"

namespace bitr::model {

/// The transpose of point_attention(layer, …).
void add_point_attention_gradient(const ops::AttentionLayer& layer, const ops::PointAttention& gradient,
                                  ops::AttentionLayer& to);

/// The transpose of pair_attention(layer, …), which is `folded`.
void add_pair_attention_gradient(const ops::AttentionLayer& layer, const ops::PairAttention& folded,
                                 const ops::PairAttention& gradient, ops::AttentionLayer& to,
                                 const ForEach& for_each);

/// The transpose of constant_radial(network, zero_length).
void add_constant_radial_gradient(const ops::RadialNetwork& network, bool zero_length,
                                  const Eigen::VectorXd& gradient, ops::RadialNetwork& to);

/// The transpose of sector_table(…), which is `table`: slopes, offsets, Q and q of every sector lead to the
/// network's weights. `channels`: in · out.
void add_sector_table_gradient(const ops::SectorTable& table, const ops::SectorTable& gradient, int channels,
                               ops::RadialNetwork& to);

}  // namespace bitr::model
