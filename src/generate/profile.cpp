#include "generate/profile.hpp"

#include <algorithm>
#include <cmath>

namespace bitr::generate {

Profile::Profile(std::vector<std::pair<double, double>> knots) : knots_(std::move(knots)) {
  const std::size_t count = knots_.size();
  std::vector<double> rise(count - 1);
  for (std::size_t i = 0; i + 1 < count; ++i)
    rise[i] = (knots_[i + 1].second - knots_[i].second) / (knots_[i + 1].first - knots_[i].first);
  slopes_.assign(count, 0);
  slopes_.front() = rise.front();
  slopes_.back() = rise.back();
  // The harmonic mean of the neighbouring rises: 0 at an extremum, and never steep enough to overshoot.
  for (std::size_t i = 1; i + 1 < count; ++i)
    if (rise[i - 1] * rise[i] > 0) slopes_[i] = 2 * rise[i - 1] * rise[i] / (rise[i - 1] + rise[i]);
}

std::size_t Profile::piece(double at) const {
  std::size_t i = 0;
  while (i + 2 < knots_.size() && at >= knots_[i + 1].first) ++i;
  return i;
}

double Profile::operator()(double at) const {
  at = std::clamp(at, first(), last());
  const std::size_t i = piece(at);
  const auto [x, y] = knots_[i];
  const double width = knots_[i + 1].first - x, t = (at - x) / width, r = 1 - t;
  return r * r * (1 + 2 * t) * y + t * t * (3 - 2 * t) * knots_[i + 1].second +
         width * t * r * (r * slopes_[i] - t * slopes_[i + 1]);
}

double Profile::slope(double at) const {
  if (at < first() || at > last()) return 0;
  const std::size_t i = piece(at);
  const auto [x, y] = knots_[i];
  const double width = knots_[i + 1].first - x, t = (at - x) / width, r = 1 - t;
  return 6 * t * r * (knots_[i + 1].second - y) / width + r * (1 - 3 * t) * slopes_[i] +
         t * (3 * t - 2) * slopes_[i + 1];
}

}  // namespace bitr::generate
