#include <algorithm>
#include <bitr/evaluate.hpp>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "core/finite.hpp"
#include "core/median.hpp"
#include "core/turn.hpp"

namespace bitr {
namespace {

/// The truth, after the turn of the object that brings it nearest to the pose.
Pose nearest_truth(const Pose& pose, const DataSample& sample) {
  if (sample.symmetry.order == 1) return sample.T_reference_source;
  const Pose T_reference_object = sample.T_reference_source * sample.T_source_object;
  const Pose between = T_reference_object.inverse() * pose * sample.T_source_object;
  const auto& [axis, order] = sample.symmetry;
  const double step = order > 0 ? 2 * std::numbers::pi / order : 0;
  const Pose turn = {.rotation = turn_about(axis, nearest_turn(between.rotation, axis, step))};
  return T_reference_object * turn * sample.T_source_object.inverse();
}

Distribution distribution(std::span<const PoseErrors> errors, double PoseErrors::*field) {
  std::vector<double> values;
  for (const PoseErrors& error : errors) values.push_back(error.*field);
  std::sort(values.begin(), values.end());
  const auto n = static_cast<double>(values.size());
  Distribution d;
  for (const double value : values) d.mean += value / n;
  double squares = 0;
  for (const double value : values) squares += (value - d.mean) * (value - d.mean);
  d.std = std::sqrt(squares / n);
  d.median = median_of_sorted(values);
  // The number of values below the true median has standard deviation √n/2.
  const auto rank = [&](double at) { return values[static_cast<std::size_t>(std::clamp(at, 0.0, n - 1))]; };
  d.median_error = (rank(n / 2 + std::sqrt(n) / 2) - rank(n / 2 - std::sqrt(n) / 2)) / 2;
  return d;
}

}  // namespace

double object_diagonal(const DataSample& sample) {
  Vec3d low, high;
  low.fill(std::numeric_limits<double>::infinity());
  high.fill(-std::numeric_limits<double>::infinity());
  const auto extend = [&](const PointCloud& cloud, const Pose& T_object_cloud) {
    for (const Vec3d& point : cloud.positions) {
      const Vec3d at = T_object_cloud.apply(point);
      for (int axis = 0; axis < 3; ++axis) {
        low[axis] = std::min(low[axis], at[axis]);
        high[axis] = std::max(high[axis], at[axis]);
      }
    }
  };
  extend(sample.source, sample.T_source_object.inverse());
  extend(sample.reference, (sample.T_reference_source * sample.T_source_object).inverse());
  return std::hypot(high[0] - low[0], high[1] - low[1], high[2] - low[2]);
}

PoseErrors errors_of(const Pose& T_reference_source, const DataSample& sample) {
  const double diagonal = object_diagonal(sample);
  if (!is_finite(T_reference_source))
    return {.rotation = 180, .translation = diagonal, .translation_fraction = 1, .failed = true};
  const Vec3d& origin = sample.T_source_object.translation;
  const Vec3d at = T_reference_source.apply(origin), expected = sample.T_reference_source.apply(origin);
  PoseErrors errors;
  errors.rotation = rotation_error_degrees(T_reference_source, nearest_truth(T_reference_source, sample));
  errors.translation = std::hypot(at[0] - expected[0], at[1] - expected[1], at[2] - expected[2]);
  errors.translation_fraction = errors.translation / diagonal;
  return errors;
}

ErrorSummary summarise(std::span<const PoseErrors> errors) {
  ErrorSummary summary;
  summary.pairs = errors.size();
  if (errors.empty()) return summary;
  summary.rotation = distribution(errors, &PoseErrors::rotation);
  summary.translation = distribution(errors, &PoseErrors::translation);
  summary.translation_fraction = distribution(errors, &PoseErrors::translation_fraction);
  const auto share = [&](auto counts) {
    return static_cast<double>(std::count_if(errors.begin(), errors.end(), counts)) /
           static_cast<double>(errors.size());
  };
  const auto within = [](double degrees, double diagonals) {
    return [=](const PoseErrors& e) { return e.rotation <= degrees && e.translation_fraction <= diagonals; };
  };
  constexpr double anywhere = std::numeric_limits<double>::infinity();
  summary.failed = static_cast<std::size_t>(
      std::count_if(errors.begin(), errors.end(), [](const PoseErrors& e) { return e.failed; }));
  summary.success_5 = share(within(5, 0.1));
  summary.success_15 = share(within(15, 0.3));
  summary.recall_5 = share(within(5, anywhere));
  summary.recall_10 = share(within(10, anywhere));
  summary.recall_20 = share(within(20, anywhere));
  summary.flips = share([](const PoseErrors& e) { return e.rotation > 135; });
  return summary;
}

}  // namespace bitr
