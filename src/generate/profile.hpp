// Smooth curves through a few given values.
#pragma once

#include <utility>
#include <vector>

namespace bitr::generate {

/// The monotone cubic through knots (Fritsch and Butland, SIAM J. Sci. Stat. Comput. 5 (1984) 300): between
/// two knots it never leaves the range of their values.
class Profile {
 public:
  /// `knots`: (place, value), places ascending, at least two.
  explicit Profile(std::vector<std::pair<double, double>> knots);
  /// Constant beyond the ends.
  double operator()(double at) const;
  double slope(double at) const;
  double first() const { return knots_.front().first; }
  double last() const { return knots_.back().first; }

 private:
  std::size_t piece(double at) const;
  std::vector<std::pair<double, double>> knots_;
  std::vector<double> slopes_;
};

}  // namespace bitr::generate
