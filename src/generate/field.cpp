#include "generate/field.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "generate/solid.hpp"

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

/// Where the field changes sign between two places at which its signs differ (the Illinois method).
double crossing(const Field& field, const Line& line, double low, double low_value, double high,
                double high_value, double tolerance) {
  int side = 0;
  for (int i = 0; i < 100 && high - low > tolerance; ++i) {
    // Every fourth step halves the bracket, so that a kink cannot stall it.
    double middle =
        i % 4 == 3 ? (low + high) / 2 : (low * high_value - high * low_value) / (high_value - low_value);
    middle = std::clamp(middle, low + tolerance / 4, high - tolerance / 4);
    const double value = field(line.at(middle));
    if ((value < 0) == (low_value < 0)) {
      low = middle;
      low_value = value;
      if (side == -1) high_value /= 2;
      side = -1;
    } else {
      high = middle;
      high_value = value;
      if (side == 1) low_value /= 2;
      side = 1;
    }
  }
  return (low + high) / 2;
}

/// At a place where the field is 0.
Vector3d outward_normal(const Field& field, const Vector3d& at, double step) {
  Vector3d gradient;
  for (int axis = 0; axis < 3; ++axis) gradient[axis] = field(at + step * Vector3d::Unit(axis));
  return gradient.normalized();
}

constexpr int grid = 32;  // cells along each side of the cube around the ball
constexpr double cell_size = 2 * solid_radius / grid;

std::size_t cell_index(const int cell[3]) {
  return (static_cast<std::size_t>(cell[0]) * grid + cell[1]) * grid + cell[2];
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
        const Vector3d hit = line.at(crossing(field, line, t, value, next_t, next_value, 1e-12 * radius));
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

FieldShape::FieldShape(Field field) : field_(std::move(field)), empty_(grid * grid * grid) {
  const int first[3] = {0, 0, 0};
  find_empty(first, grid);
  radius_ = std::min(radius_, solid_radius);
}

void FieldShape::find_empty(const int first[3], int cells) {
  const Vector3d middle =
      cell_size * (Vector3d(first[0], first[1], first[2]) + Vector3d::Constant(cells / 2.0)) -
      Vector3d::Constant(solid_radius);
  const double half_diagonal = std::sqrt(3) / 2 * cells * cell_size;
  if (std::abs(field_(middle)) > half_diagonal) {
    for (int i = 0; i < cells; ++i)
      for (int j = 0; j < cells; ++j)
        for (int k = 0; k < cells; ++k) {
          const int cell[3] = {first[0] + i, first[1] + j, first[2] + k};
          empty_[cell_index(cell)] = static_cast<std::uint8_t>(cells);
        }
    return;
  }
  if (cells == 1) {
    radius_ = std::max(radius_, middle.norm() + half_diagonal);
    return;
  }
  for (int corner = 0; corner < 8; ++corner) {
    int at[3];
    for (int axis = 0; axis < 3; ++axis) at[axis] = first[axis] + (corner >> axis & 1) * cells / 2;
    find_empty(at, cells / 2);
  }
}

double FieldShape::weight() const {
  // A line that meets the ball crosses a surface of area A within it A / (2π radius²) times on average.
  return 2 * std::numbers::pi * radius_ * radius_;
}

void FieldShape::trial(Random& random, std::vector<SurfacePoint>& points) const {
  // A line that is inside for less than the shortest step may be missed: less than one in a thousand of those
  // that pass within a radius of curvature of 0.03.
  constexpr double shortest_step = 2e-3, margin = 1e-9;
  const Line line = random_chord(radius_, random);
  const Vector3d per_length = line.direction.cwiseInverse();
  double last_t = 0, last_value = 1;  // where the field was last asked; the ball's surface is outside
  for (double t = 0; last_t < line.length;) {
    if (t < line.length) {
      const Vector3d at = line.at(t);
      int cell[3];
      for (int axis = 0; axis < 3; ++axis)
        cell[axis] = std::clamp(static_cast<int>((at[axis] + solid_radius) / cell_size), 0, grid - 1);
      if (const int block = empty_[cell_index(cell)]) {
        double leave = line.length;
        for (int axis = 0; axis < 3; ++axis) {
          const int wall = cell[axis] / block * block + (line.direction[axis] > 0 ? block : 0);
          leave = std::min(
              leave, t + std::max(0.0, (cell_size * wall - solid_radius - at[axis]) * per_length[axis]));
        }
        t = leave + margin;
        continue;
      }
    }
    t = std::min(t, line.length);
    const double value = field_(line.at(t));
    if ((value < 0) != (last_value < 0)) {
      const Vector3d hit = line.at(crossing(field_, line, last_t, last_value, t, value, 1e-12));
      points.push_back({hit, outward_normal(field_, hit, 1e-6)});
    }
    last_t = t;
    last_value = value;
    t += std::max(std::abs(value), shortest_step);
  }
}

}  // namespace bitr::generate
