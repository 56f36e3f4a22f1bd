// Named parameters as one vector: in the order of their names, each row by row.
#pragma once

#include <span>
#include <vector>

#include "train/differentiator.hpp"

namespace bitr::train {

std::size_t flat_size(const model::Weights& weights);

std::vector<double> flatten(const model::Weights& weights);

/// flat += scale · gradients. A parameter that the gradients lack or have in another shape: Failure
/// (internal).
void add_gradients(const model::Weights& weights, const Gradients& gradients, double scale,
                   std::span<double> flat);

/// The other way: the weights take the vector's values.
void unflatten(std::span<const double> flat, model::Weights& weights);

}  // namespace bitr::train
