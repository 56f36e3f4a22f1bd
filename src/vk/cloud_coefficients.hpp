// The weights of cloud_coefficients.comp and of its gradient.
#pragma once

#include <vector>

#include "ops/cloud_coefficients.hpp"

namespace bitr::vk {

/// One after the other, as cloud_coefficients.comp reads them. `globals`: scalars of a cloud. Throws Failure
/// (`internal`) for other features than those that a cloud is extended by.
std::vector<Eigen::MatrixXd> cloud_layer_weights(const ops::CloudCoefficients& op, int globals);

}  // namespace bitr::vk
