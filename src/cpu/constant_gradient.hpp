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

/// The gradient of an operation's constants: the sum over rows, of fixed pieces of at least `least` rows,
/// each with a place of its own, in order. body(begin, end, part) adds rows [begin, end) to `part`.
template <class Operation, class Body>
Operation sum_constants(const Arguments& args, const Operation& op, std::size_t rows, std::size_t least,
                        Body body) {
  constexpr std::size_t most_pieces = 16;  // bounds the memory
  const std::size_t piece = std::max(least, (rows + most_pieces - 1) / most_pieces);
  Operation sum = ops::zeros_like(op);
  std::vector<Operation> parts;
  for (std::size_t begin = 0; begin < rows; begin += piece) parts.push_back(ops::zeros_like(op));
  args.pool.parallel_for(parts.size(), 1, [&](std::size_t first, std::size_t last) {
    for (std::size_t i = first; i < last; ++i) body(i * piece, std::min(rows, (i + 1) * piece), parts[i]);
  });
  for (Operation& part : parts) ops::add_constants(sum, part);
  return sum;
}

}  // namespace bitr::cpu
