#include "generate/primitive.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace bitr::generate {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// Half the thickness of the symmetric four-digit section, 1 at its thickest, a share `chord` of its length
// behind the leading edge.
double airfoil(double chord) {
  return 10 * (0.2969 * std::sqrt(chord) +
               chord * (-0.1260 + chord * (-0.3516 + chord * (0.2843 - 0.1036 * chord))));
}

// How far a lip with a beak reaches at an angle from its middle.
constexpr double beak_width = 0.45;
double reach(double beak, double angle) {
  return beak == 0 ? 1 : 1 + beak * std::exp(-angle * angle / (beak_width * beak_width));
}

}  // namespace

Primitive::Primitive(const std::vector<double>& stations, int columns) : columns_(columns) {
  rings_.push_back({stations.front(), 0});
  rings_.push_back({stations.front(), 0.5});
  for (const double along : stations) rings_.push_back({along, 1});
  rings_.push_back({stations.back(), 0.5});
  rings_.push_back({stations.back(), 0});
}

Primitive::Ring Primitive::ring(double row) const {
  const auto below = static_cast<std::size_t>(std::clamp(row, 0.0, rows() - 1.0));
  const double share = row - static_cast<double>(below);
  const Ring &a = rings_[below], &b = rings_[below + 1];
  return {a.along + share * (b.along - a.along), a.scale + share * (b.scale - a.scale)};
}

Primitive::Ring Primitive::ring_step(double row) const {
  const auto below = static_cast<std::size_t>(std::clamp(row, 0.0, rows() - 1.0));
  const Ring &a = rings_[below], &b = rings_[below + 1];
  return {b.along - a.along, b.scale - a.scale};
}

double Primitive::angle(double column) const { return 2 * std::numbers::pi * column / columns_; }

Loft::Loft(const Vector3d& axis, const Vector3d& u, Outline outline, Cut cut,
           const std::vector<double>& stations, int columns)
    : Primitive(stations, columns),
      axis_(axis),
      u_(u),
      v_(axis.cross(u)),
      outline_(outline),
      cut_(std::move(cut)),
      first_(stations.front()),
      last_(stations.back()) {}

bool Loft::contains(const Vector3d& at) const {
  const double along = axis_.dot(at);
  if (along <= first_ || along >= last_) return false;
  const Section section = cut_(along);
  const double p = (u_.dot(at) - section.u) / section.half_u, q = (v_.dot(at) - section.v) / section.half_v;
  if (outline_ == Outline::airfoil) return std::abs(p) < 1 && std::abs(q) < airfoil((1 - p) / 2);
  const double limit = section.beak == 0 ? 1 : reach(section.beak, std::atan2(q, p));
  return p * p + q * q < limit * limit;
}

Loft::Unit Loft::unit(double beak, double turn) const {
  const double cosine = std::cos(turn), sine = std::sin(turn);
  if (outline_ == Outline::airfoil) {
    // The chord is sin²(turn/2), whose root is smooth over the leading edge.
    const double chord = std::clamp((1 - cosine) / 2, 0.0, 1.0), side = turn <= std::numbers::pi ? 1 : -1;
    const double slope = -0.1260 + chord * (-0.7032 + chord * (0.8529 - 0.4144 * chord));
    return {cosine, side * airfoil(chord), -sine, side * 5 * (0.2969 * std::cos(turn / 2) + slope * sine)};
  }
  if (beak == 0) return {cosine, sine, -sine, cosine};
  if (turn > std::numbers::pi) turn -= 2 * std::numbers::pi;
  const double factor = reach(beak, turn), slope = -2 * turn / (beak_width * beak_width) * (factor - 1);
  return {factor * cosine, factor * sine, slope * cosine - factor * sine, slope * sine + factor * cosine};
}

Vector3d Loft::at(const Ring& ring, const Section& section, const Unit& unit) const {
  return ring.along * axis_ + (section.u + ring.scale * section.half_u * unit.p) * u_ +
         (section.v + ring.scale * section.half_v * unit.q) * v_;
}

Primitive::Place Loft::place(double row, double column) const {
  const Ring here = ring(row), step = ring_step(row);
  const Section section = cut_(here.along);
  const double turn = angle(column), per_column = 2 * std::numbers::pi / columns();
  const Unit unit = this->unit(section.beak, turn);
  Place place;
  place.at = at(here, section, unit);
  place.by_column = here.scale * per_column *
                    (section.half_u * unit.by_angle_p * u_ + section.half_v * unit.by_angle_q * v_);
  if (step.along == 0) {
    place.by_row = step.scale * (section.half_u * unit.p * u_ + section.half_v * unit.q * v_);
    return place;
  }
  // The difference stays within the cell, beyond which the surface may turn sharply.
  const double share = row - std::floor(row) < 0.5 ? 1e-5 : -1e-5;
  const Section next = cut_(here.along + share * step.along);
  place.by_row = (at({here.along + share * step.along, here.scale}, next,
                     next.beak == section.beak ? unit : this->unit(next.beak, turn)) -
                  place.at) /
                 share;
  return place;
}

std::vector<Vector3d> Loft::corners() const {
  std::vector<Unit> units;
  double beak = -1;  // the one that `units` were made for
  std::vector<Vector3d> corners;
  corners.reserve(static_cast<std::size_t>(rows() + 1) * (columns() + 1));
  for (int i = 0; i <= rows(); ++i) {
    const Ring here = ring(i);
    const Section section = cut_(here.along);
    if (section.beak != beak) {
      beak = section.beak;
      units.clear();
      for (int j = 0; j <= columns(); ++j) units.push_back(unit(beak, angle(j)));
    }
    for (const Unit& unit : units) corners.push_back(at(here, section, unit));
  }
  return corners;
}

Bow::Bow(const Tube& tube) : Primitive(even_steps(0, 1, 20), 16), tube_(tube) {
  constexpr int pieces = 40;
  for (int i = 0; i <= pieces; ++i) path_.push_back(point(static_cast<double>(i) / pieces));
}

Vector3d Bow::point(double t) const {
  const auto& c = tube_.curve;
  const double r = 1 - t;
  return r * r * r * c[0] + 3 * r * r * t * c[1] + 3 * r * t * t * c[2] + t * t * t * c[3];
}

Vector3d Bow::velocity(double t) const {
  const auto& c = tube_.curve;
  const double r = 1 - t;
  return 3 * (r * r * (c[1] - c[0]) + 2 * r * t * (c[2] - c[1]) + t * t * (c[3] - c[2]));
}

Vector3d Bow::acceleration(double t) const {
  const auto& c = tube_.curve;
  return 6 * ((1 - t) * (c[2] - 2 * c[1] + c[0]) + t * (c[3] - 2 * c[2] + c[1]));
}

bool Bow::contains(const Vector3d& at) const {
  double nearest = std::numeric_limits<double>::infinity(), t = 0;
  for (std::size_t i = 0; i + 1 < path_.size(); ++i) {
    const Vector3d step = path_[i + 1] - path_[i];
    const double share = std::clamp(step.dot(at - path_[i]) / step.squaredNorm(), 0.0, 1.0);
    const double squared = (at - path_[i] - share * step).squaredNorm();
    if (squared >= nearest) continue;
    nearest = squared;
    t = (static_cast<double>(i) + share) / static_cast<double>(path_.size() - 1);
  }
  // Newton's steps from the path's nearest place to the curve's.
  for (int i = 0; i < 3; ++i) {
    const Vector3d offset = at - point(t), speed = velocity(t);
    const double bend = speed.squaredNorm() - offset.dot(acceleration(t));
    if (bend > 0) t = std::clamp(t + offset.dot(speed) / bend, 0.0, 1.0);
  }
  const Vector3d offset = at - point(t), along = velocity(t).normalized();
  if ((t == 0 && offset.dot(along) < 0) || (t == 1 && offset.dot(along) > 0)) return false;
  const Vector2d half(std::lerp(tube_.half_in[0], tube_.half_in[1], t),
                      std::lerp(tube_.half_across[0], tube_.half_across[1], t));
  return Vector2d(offset.dot(tube_.across.cross(along)), offset.dot(tube_.across))
             .cwiseQuotient(half)
             .norm() < 1;
}

Primitive::Place Bow::place(double row, double column) const {
  const Ring here = ring(row), step = ring_step(row);
  const double t = here.along, turn = angle(column), per_column = 2 * std::numbers::pi / columns();
  const double in = std::lerp(tube_.half_in[0], tube_.half_in[1], t),
               across = std::lerp(tube_.half_across[0], tube_.half_across[1], t);
  const Vector3d speed = velocity(t), along = speed.normalized(), side = tube_.across.cross(along);
  const Vector3d bend = acceleration(t), turning = (bend - along.dot(bend) * along) / speed.norm();
  const double cosine = std::cos(turn), sine = std::sin(turn);
  const Vector3d radial = in * cosine * side + across * sine * tube_.across;
  const Vector3d growth = (tube_.half_in[1] - tube_.half_in[0]) * cosine * side +
                          (tube_.half_across[1] - tube_.half_across[0]) * sine * tube_.across;
  return {point(t) + here.scale * radial,
          step.along * (speed + here.scale * (growth + in * cosine * tube_.across.cross(turning))) +
              step.scale * radial,
          here.scale * per_column * (-in * sine * side + across * cosine * tube_.across)};
}

std::vector<Vector3d> Bow::corners() const {
  std::vector<Vector3d> corners;
  for (int i = 0; i <= rows(); ++i)
    for (int j = 0; j <= columns(); ++j) corners.push_back(place(i, j).at);
  return corners;
}

std::vector<double> even_steps(double low, double high, int count) {
  std::vector<double> steps;
  for (int i = 0; i <= count; ++i) steps.push_back(std::lerp(low, high, static_cast<double>(i) / count));
  return steps;
}

std::vector<double> steps_from_tip(double low, double high, int count) {
  std::vector<double> steps = even_steps(0, 1, count);
  for (double& step : steps) step = std::lerp(low, high, step * step);
  return steps;
}

std::vector<double> joined(std::initializer_list<std::vector<double>> runs) {
  std::vector<double> all;
  for (const auto& run : runs)
    for (const double place : run)
      if (all.empty() || place > all.back() + 1e-9) all.push_back(place);
  return all;
}

}  // namespace bitr::generate
