// The middle of some values.
#pragma once

#include <algorithm>
#include <vector>

namespace bitr {

/// At least one value. An even number's median is the mean of its middle two.
inline double median_of_sorted(const std::vector<double>& sorted) {
  return (sorted[(sorted.size() - 1) / 2] + sorted[sorted.size() / 2]) / 2;
}
inline double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return median_of_sorted(values);
}

}  // namespace bitr
