// gradient: a loss's gradient with respect to an operation's inputs and constants, from that of its outputs.
// Sums run in a fixed order: the same bits on every run and for any number of threads.
// in  the operation's inputs, of their shapes
// in  the operation's outputs, of their shapes
// in  the gradients of the outputs `grad_outputs`, of their shapes
// out the gradients of the inputs `needs_input_grad`, of their shapes
// out the gradient of the constants, if `constants`: T[1, constant_count(op)] (ops/constants.hpp)
// error float_error(), relative to the largest entry of the output
#pragma once

#include <algorithm>
#include <vector>

namespace bitr::ops {

/// Gradients jump where an attention layer has a kink, as between the sectors of a radial table, and a number
/// in float may be on its other side. There an entry differs by up to kink_error; 19 in 20 stay within
/// smooth_error.
constexpr double kink_error = 1e-3, smooth_error = 2e-5;

/// What the CPU holds for every operation's gradient, relative to the larger of the output's largest entry and
/// a hundredth of all outputs' largest one.
constexpr double cpu_gradient_error = 1e-4;

template <class Operation>
struct Gradient {
  Operation op;
  int inputs = 0, outputs = 0;        ///< how many the operation has
  std::vector<int> grad_outputs;      ///< outputs whose gradient is an input, ascending
  std::vector<int> needs_input_grad;  ///< inputs whose gradient is made, ascending
  bool constants = false;             ///< the operation has constants

  /// Place among the inputs of the gradient of output `i`; −1: it is zero.
  int grad_output_at(int i) const { return at(grad_outputs, i, inputs + outputs); }
  /// Place among the outputs of the gradient of input `i`; −1: not needed.
  int grad_input_at(int i) const { return at(needs_input_grad, i, 0); }
  int constants_at() const { return constants ? static_cast<int>(needs_input_grad.size()) : -1; }

  double float_error() const {
    if constexpr (requires { Operation::gradient_error; })
      return Operation::gradient_error;
    else
      return cpu_gradient_error;
  }

 private:
  static int at(const std::vector<int>& list, int i, int first) {
    const auto it = std::find(list.begin(), list.end(), i);
    return it == list.end() ? -1 : first + static_cast<int>(it - list.begin());
  }
};

}  // namespace bitr::ops
