#include "restriction.hpp"

#include <CLI/CLI.hpp>
#include <cmath>

#include "options.hpp"

namespace bitr::tool {
namespace {

Vec3d parse_axis(const std::string& text) {
  Vec3d axis{};
  if (text == "x" || text == "y" || text == "z") {
    axis[static_cast<std::size_t>(text[0] - 'x')] = 1;
    return axis;
  }
  const bool good = parse_vector(text, axis);
  const double length = std::hypot(axis[0], axis[1], axis[2]);
  if (!good || !(length >= 1e-100))
    throw CLI::ValidationError("--yaw-only", "\"" + text +
                                                 "\" is not x, y, z or three numbers such as 0,0,1; the axis "
                                                 "follows as in --yaw-only=z");
  for (double& value : axis) value /= length;
  return axis;
}

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
