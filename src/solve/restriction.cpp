#include <bitr/restriction.hpp>
#include <charconv>
#include <cstdio>
#include <numbers>

#include "core/turn.hpp"

namespace bitr {
namespace {

// As of a rotation that is not determined (Diagnostics::rotation_gap): rounding decides below it.
constexpr double least_margin = 1e-3;

std::string name_of(const Vec3d& axis) {
  std::string name;
  for (const double value : axis) {
    char digits[32];
    const char* end = std::to_chars(digits, digits + sizeof digits, value).ptr;
    name += (name.empty() ? "(" : ", ") + std::string(static_cast<const char*>(digits), end);
  }
  return name + ")";
}

}  // namespace

std::string Restricted::problem() const {
  if (!margin || *margin >= least_margin) return {};
  return "the turn about " + name_of(*restriction.axis) +
         " is not determined: the rotation is as far from every one";
}

Restricted restricted(const Restriction& restriction, const Pose& pose, const Vec3d& source_centroid) {
  Restricted result{restriction, {}, 0, {}};
  if (restriction.axis) {
    const Turn nearest = best_turn(pose.rotation, *restriction.axis);
    result.pose.rotation = turn_about(*restriction.axis, nearest.angle);
    result.turn_degrees = nearest.angle * 180 / std::numbers::pi;
    result.margin = nearest.margin;
  }
  const Vec3d goes_to = pose.apply(source_centroid), turned = result.pose.rotate(source_centroid);
  for (int a = 0; a < 3; ++a) result.pose.translation[a] = goes_to[a] - turned[a];
  return result;
}

void follow(const Pose& pose, const Vec3d& source_centroid, Restricted& restricted) {
  restricted.pose = pose;
  restricted.turn_degrees = bitr::restricted(restricted.restriction, pose, source_centroid).turn_degrees;
}

std::string describe(const Restricted& restricted) {
  if (!restricted.restriction.axis) return "a shift";
  char degrees[32];
  std::snprintf(degrees, sizeof degrees, "%.4g", restricted.turn_degrees);
  return std::string("a turn of ") + degrees + "° about " + name_of(*restricted.restriction.axis) +
         " and a shift";
}

}  // namespace bitr
