// Sums over pairs or clouds of what each adds to the gradient of an operation's constants.
#pragma once

#include "vk/kernel.hpp"

namespace bitr::vk {

class RowSums {
 public:
  explicit RowSums(const Context& context);
  /// `sum`: of the `rows` rows of `addends`, each as wide as it; in their order.
  void record(Schedule& schedule, const Range& addends, std::uint32_t rows, const Range& sum) const;

 private:
  PipelineOf<RowSumParameters> pipeline_;
};

}  // namespace bitr::vk
