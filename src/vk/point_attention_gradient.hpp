// Gradient of point_attention, shared with that of mean_direction.
#pragma once

#include <optional>

#include "vk/kernel.hpp"

namespace bitr::vk {

/// Places of tensors among a node's inputs and outputs; −1: none.
struct PointGradientSlots {
  int features = -1, index = -1, centres = -1, neighbors = -1, coefficients = -1, grad_output = -1;
  int d_features = -1, d_centres = -1, d_coefficients = -1, d_constants = -1;
  std::optional<double> constant = {};  ///< the feature of all points, if there is no tensor of them
};

/// Bytes of what point_attention.comp keeps of a row for the gradient.
std::size_t saved_row_bytes(const ops::PointAttention& op);

KernelPtr make_point_gradient(const KernelContext& site, const ops::PointAttention& op,
                              const PointGradientSlots& slots);

}  // namespace bitr::vk
