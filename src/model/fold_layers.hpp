// The algebra of the fold, layer by layer: constants in, constants out.
#pragma once

#include "core/for_each.hpp"
#include "ops/attention_layer.hpp"
#include "ops/cloud_coefficients.hpp"
#include "ops/extend_features.hpp"
#include "ops/mean_direction.hpp"
#include "ops/pair_attention.hpp"
#include "ops/point_attention.hpp"
#include "ops/projected_relu.hpp"

namespace bitr::model {

/// The matrix of one degree with its skip connection added; empty where the map has no such degree.
Eigen::MatrixXd with_skip(const ops::Linear& linear, irreps::Degree d);

/// The radial network of a one-sided layer, which does not depend on the edge's length r > 0: LN(r w) =
/// LN(w). At r = 0 its first LayerNorm gives its bias.
Eigen::VectorXd constant_radial(const ops::RadialNetwork& network, bool zero_length);

/// A one-sided layer and the ReLU behind it (or nullptr).
ops::PointAttention point_attention(const ops::AttentionLayer& layer, const ops::ProjectedRelu* relu);

/// `first` reads one scalar channel, the same constant at every point.
ops::MeanDirection mean_direction(const ops::PointAttention& first, double constant);

/// `full` reads extended features.
ops::CloudCoefficients cloud_coefficients(const ops::PointAttention& full, const ops::ExtendFeatures& extend);

/// A two-sided layer and the ReLU behind it (or nullptr).
ops::PairAttention pair_attention(const ops::AttentionLayer& layer, const ops::ProjectedRelu* relu,
                                  const ForEach& for_each = one_by_one);

/// Sectors of a two-input network; coefficients in the order of ops::PairBlock, `basis` applied.
ops::SectorTable sector_table(const std::shared_ptr<const ops::RadialNetwork>& network,
                              const Eigen::MatrixXd& basis, int in_channels, int out_channels, double scale);

}  // namespace bitr::model
