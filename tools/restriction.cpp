#include "restriction.hpp"

#include <CLI/CLI.hpp>
#include <cmath>
#include <numbers>

#include "core/turn.hpp"
#include "io/complaint.hpp"
#include "io/lines.hpp"

namespace bitr::tool {
namespace {

// As of a rotation that is not determined (Diagnostics::rotation_gap): rounding decides below it.
constexpr double least_margin = 1e-3;

Vec3d parse_axis(const std::string& text) {
  Vec3d axis{};
  if (text == "x" || text == "y" || text == "z") {
    axis[static_cast<std::size_t>(text[0] - 'x')] = 1;
    return axis;
  }
  bool good = true;
  std::size_t at = 0;
  for (std::size_t i = 0; i < 3 && good; ++i) {
    const std::size_t end = i < 2 ? text.find(',', at) : text.size();
    good = end != std::string::npos && io::parse_number(text.substr(at, end - at), axis[i]) &&
           std::abs(axis[i]) <= 1e100;
    at = end + 1;
  }
  const double length = std::hypot(axis[0], axis[1], axis[2]);
  if (!good || !(length >= 1e-100))
    throw CLI::ValidationError("--yaw-only", "\"" + text +
                                                 "\" is not x, y, z or three numbers such as 0,0,1; the axis "
                                                 "follows as in --yaw-only=z");
  for (double& value : axis) value /= length;
  return axis;
}

std::string name_of(const Vec3d& axis) { return io::text("(", axis[0], ", ", axis[1], ", ", axis[2], ")"); }

}  // namespace

void add_restriction_options(CLI::App& app, Restriction& restriction) {
  auto* translation =
      app.add_flag("--translation-only", restriction.translation, "Restrict the pose to a shift, see below");
  app.add_option_function<std::string>(
         "--yaw-only", [&restriction](const std::string& text) { restriction.axis = parse_axis(text); },
         "Restrict the pose to a turn about this axis of the frames, and a shift, see below")
      ->expected(0, 1)
      ->type_name("x|y|z|X,Y,Z")
      ->default_str("z")
      ->excludes(translation);
}

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
  restricted.turn_degrees = tool::restricted(restricted.restriction, pose, source_centroid).turn_degrees;
}

Restricted restrict_assembly(const Restriction& restriction, const Vec3d& source_centroid,
                             Assembly& assembly) {
  Restricted result = restricted(restriction, assembly.T_reference_source, source_centroid);
  assembly.T_reference_source = result.pose;
  if (const std::string problem = result.problem(); !problem.empty()) {
    std::string& reason = assembly.diagnostics.reason;
    reason += (reason.empty() ? "" : "; ") + problem;
    assembly.diagnostics.degenerate = true;
    assembly.status = Status::degenerate;
  }
  return result;
}

std::string describe(const Restricted& restricted) {
  if (!restricted.restriction.axis) return "a shift";
  char degrees[32];
  std::snprintf(degrees, sizeof degrees, "%.4g", restricted.turn_degrees);
  return std::string("a turn of ") + degrees + "° about " + name_of(*restricted.restriction.axis) +
         " and a shift";
}

Json to_json(const Restriction& restriction) {
  Json json = nullptr;
  if (restriction.any()) json["family"] = restriction.axis ? "turn" : "translation";
  if (restriction.axis) json["axis"] = *restriction.axis;
  return json;
}

Json to_json(const Restricted& restricted) {
  Json json = to_json(restricted.restriction);
  if (!restricted.margin) return json;
  json["turn_degrees"] = restricted.turn_degrees;
  json["margin"] = *restricted.margin;
  return json;
}

}  // namespace bitr::tool
