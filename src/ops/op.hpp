// Every operation a graph may hold.
#pragma once

#include <type_traits>
#include <variant>

#include "ops/attend.hpp"
#include "ops/attention_layer.hpp"
#include "ops/cg_product.hpp"
#include "ops/cloud_coefficients.hpp"
#include "ops/cloud_softmax.hpp"
#include "ops/cloud_sum.hpp"
#include "ops/convolve.hpp"
#include "ops/edge_geometry.hpp"
#include "ops/extend_features.hpp"
#include "ops/gradient.hpp"
#include "ops/head.hpp"
#include "ops/input_features.hpp"
#include "ops/knn.hpp"
#include "ops/linear.hpp"
#include "ops/loss.hpp"
#include "ops/mean_direction.hpp"
#include "ops/merge_pairs.hpp"
#include "ops/neighbour_attention.hpp"
#include "ops/pair_attention.hpp"
#include "ops/point_attention.hpp"
#include "ops/pose.hpp"
#include "ops/projected_relu.hpp"
#include "ops/softmax_sum.hpp"
#include "ops/sum.hpp"

namespace bitr::ops {

using Op = std::variant<
    AttentionLayer, Knn, EdgeGeometry, InputFeatures, Convolve, Linear, Attend, ProjectedRelu, CloudSoftmax,
    CloudSum, ExtendFeatures, MergePairs, Head, ProjectPose, MeanDirection, PointAttention, CloudCoefficients,
    SoftmaxSum, PairAttention, CgProduct, NeighbourAttention, Loss, Sum,
    // Training. As defined:
    Gradient<EdgeGeometry>, Gradient<Convolve>, Gradient<Linear>, Gradient<Attend>, Gradient<ProjectedRelu>,
    Gradient<CloudSoftmax>, Gradient<CloudSum>, Gradient<ExtendFeatures>,
    // folded:
    Gradient<MeanDirection>, Gradient<PointAttention>, Gradient<CloudCoefficients>, Gradient<SoftmaxSum>,
    Gradient<PairAttention>,
    // both:
    Gradient<MergePairs>, Gradient<Head>, Gradient<ProjectPose>, Gradient<Loss>>;

/// Bound on the difference of float from double on the same inputs, relative to what the operation's header says;
/// 0: none. A composite has none of its own.
inline double float_error(const Op& op) {
  return std::visit(
      [](const auto& concrete) -> double {
        if constexpr (std::is_same_v<std::decay_t<decltype(concrete)>, AttentionLayer>)
          return 0;
        else
          return concrete.float_error();
      },
      op);
}

/// Whether a variant's alternatives include an operation's gradient.
template <class Operation, class Variant = Op>
struct has_gradient;
template <class Operation, class... All>
struct has_gradient<Operation, std::variant<All...>>
    : std::bool_constant<(std::is_same_v<Gradient<Operation>, All> || ...)> {};

}  // namespace bitr::ops
