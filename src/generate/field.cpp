#include "generate/field.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace bitr::generate {
namespace {

using Eigen::Vector3d;

struct Line {
  Vector3d origin, direction;
  double length;
  Vector3d at(double t) const { return origin + t * direction; }
};

Line random_chord(double radius, Random& random) {
  const auto frame = random.rotation();
  const Vector3d direction(frame[0], frame[1], frame[2]), side(frame[3], frame[4], frame[5]),
      up(frame[6], frame[7], frame[8]);
  const double offset = radius * std::sqrt(random.uniform());
  const double angle = random.uniform(0, 2 * std::numbers::pi);
  const double half = std::sqrt(radius * radius - offset * offset);
  return {offset * (std::cos(angle) * side + std::sin(angle) * up) - half * direction, direction, 2 * half};
}

double bisect(const Field& field, const Line& line, double low, double high, double tolerance) {
  const bool inside_at_low = field(line.at(low)) < 0;
  while (high - low > tolerance) {
    const double middle = (low + high) / 2;
    ((field(line.at(middle)) < 0) == inside_at_low ? low : high) = middle;
  }
  return (low + high) / 2;
}

Vector3d outward_normal(const Field& field, const Vector3d& at, double step) {
  Vector3d gradient;
  for (int axis = 0; axis < 3; ++axis) {
    const Vector3d shift = step * Vector3d::Unit(axis);
    gradient[axis] = field(at + shift) - field(at - shift);
  }
  return gradient.normalized();
}

}  // namespace

PointCloud sample_surface(const Field& field, double radius, std::size_t count, Random& random) {
  PointCloud cloud;
  cloud.positions.reserve(count);
  cloud.normals.reserve(count);
  // The field bounds the distance, so it sets the step; the shortest step only guards against stalling.
  const double shortest_step = 4e-4 * radius;
  while (cloud.size() < count) {
    const Line line = random_chord(radius, random);
    double t = 0, value = field(line.at(0));
    while (t < line.length && cloud.size() < count) {
      const double next_t = std::min(line.length, t + std::max(std::abs(value), shortest_step));
      const double next_value = field(line.at(next_t));
      if ((value < 0) != (next_value < 0)) {
        const Vector3d hit = line.at(bisect(field, line, t, next_t, 1e-12 * radius));
        const Vector3d normal = outward_normal(field, hit, 1e-6 * radius);
        cloud.positions.push_back({hit.x(), hit.y(), hit.z()});
        cloud.normals.push_back(
            {static_cast<float>(normal.x()), static_cast<float>(normal.y()), static_cast<float>(normal.z())});
      }
      t = next_t;
      value = next_value;
    }
  }
  return cloud;
}

}  // namespace bitr::generate
