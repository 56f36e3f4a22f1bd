// Gradient of point_attention, shared with that of mean_direction.
#pragma once

#include "cpu/point_attention.hpp"

namespace bitr::cpu {

/// Where the gradients go; nullptr: not wanted.
template <class T>
struct PointGradients {
  T* features = nullptr;
  T* centres = nullptr;
  T* neighbors = nullptr;
  T* coefficients = nullptr;
  const Slot* constants = nullptr;
};

/// `queries`: what the layer's output has a row of. `given`: the gradient of the output; `in.out` is not
/// used. `coefficients`: nullptr unless they come per cloud.
template <class T>
void point_attention_gradient(const Arguments& args, const ops::PointAttention& op, graph::Rows queries,
                              int k, const PointInputs<T>& in, const T* grad_output, const T* coefficients,
                              const PointGradients<T>& out);

}  // namespace bitr::cpu
