// Every operation a graph may hold.
#pragma once

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
#include "ops/head.hpp"
#include "ops/input_features.hpp"
#include "ops/knn.hpp"
#include "ops/linear.hpp"
#include "ops/mean_direction.hpp"
#include "ops/merge_pairs.hpp"
#include "ops/neighbour_attention.hpp"
#include "ops/pair_attention.hpp"
#include "ops/point_attention.hpp"
#include "ops/pose.hpp"
#include "ops/projected_relu.hpp"
#include "ops/softmax_sum.hpp"

namespace bitr::ops {

using Op =
    std::variant<AttentionLayer, Knn, EdgeGeometry, InputFeatures, Convolve, Linear, Attend, ProjectedRelu,
                 CloudSoftmax, CloudSum, ExtendFeatures, MergePairs, Head, ProjectPose, MeanDirection,
                 PointAttention, CloudCoefficients, SoftmaxSum, PairAttention, CgProduct, NeighbourAttention>;

}  // namespace bitr::ops
