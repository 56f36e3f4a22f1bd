// The gradient of an operation's constants on its way into a tensor.
#pragma once

#include <algorithm>

#include "cpu/kernel.hpp"
#include "ops/constants.hpp"

namespace bitr::cpu {

/// `gradient`: an operation whose constants are gradients (ops::zeros_like, filled); `slot` null: not wanted.
template <class T, class Operation>
void store_constants(const Slot* slot, Operation& gradient) {
  if (!slot) return;
  T* to = slot->as<T>();
  for (const auto& span : ops::constants(gradient))
    to = std::transform(span.begin(), span.end(), to, [](double x) { return static_cast<T>(x); });
}

/// Adds one operation's constants to another's of the same shape.
template <class Operation>
void add_constants(Operation& sum, Operation& part) {
  const auto to = ops::constants(sum), from = ops::constants(part);
  for (std::size_t s = 0; s < to.size(); ++s)
    for (std::size_t i = 0; i < to[s].size(); ++i) to[s][i] += from[s][i];
}

}  // namespace bitr::cpu
