#include "generate/vessels.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "generate/compound.hpp"
#include "generate/profile.hpp"

namespace bitr::generate {
namespace {

using Eigen::Vector3d;

// Everything is in units of the vessel's height until the compound is finished.
struct Plan {
  std::vector<std::pair<double, double>> outer;  ///< (height, radius) from the foot to the rim
  double wall = 0.03;
  double floor = 0.04;  ///< the cavity begins here
  bool solid = false;
  int handles = 0;
  double handle_low = 0.2, handle_high = 0.8;  ///< where they meet the wall
  double handle_reach = 0.25;                  ///< beyond the widest place between
  bool spout = false;
  double beak = 0;
};

Plan bowl(Random& random) {
  const double rim = random.uniform(0.7, 1.4), foot = rim * random.uniform(0.3, 0.5);
  const double belly = random.uniform(0.75, 0.95);
  return {.outer = {{0, foot},
                    {0.12, foot * random.uniform(0.9, 1.1)},
                    {0.4, rim * belly * random.uniform(0.75, 0.9)},
                    {0.7, rim * belly},
                    {1, rim}},
          .wall = random.uniform(0.05, 0.09),
          .floor = random.uniform(0.12, 0.2)};
}

Plan cup(Random& random) {
  const double rim = random.uniform(0.38, 0.5), foot = rim * random.uniform(0.6, 1.0);
  Plan plan{.outer = {{0, foot}, {0.3, std::lerp(foot, rim, random.uniform(0.3, 0.8))}, {1, rim}},
            .wall = random.uniform(0.035, 0.06),
            .floor = random.uniform(0.06, 0.1)};
  plan.handles = random.uniform() < 0.8 ? 1 : 0;
  plan.handle_low = random.uniform(0.15, 0.3);
  plan.handle_high = random.uniform(0.7, 0.9);
  plan.handle_reach = random.uniform(0.22, 0.34);
  return plan;
}

Plan vase(Random& random) {
  const double belly = random.uniform(0.2, 0.4), at = random.uniform(0.3, 0.6);
  const double neck = belly * random.uniform(0.35, 0.6);
  return {.outer = {{0, belly * random.uniform(0.45, 0.75)},
                    {0.06, belly * random.uniform(0.45, 0.7)},
                    {at, belly},
                    {random.uniform(0.76, 0.86), neck},
                    {1, neck * random.uniform(1.2, 1.9)}},
          .wall = random.uniform(0.025, 0.045),
          .floor = random.uniform(0.04, 0.07)};
}

Plan bottle(Random& random) {
  const double belly = random.uniform(0.16, 0.26), shoulder = random.uniform(0.5, 0.68);
  const double neck = belly * random.uniform(0.3, 0.42);
  return {.outer = {{0, belly * random.uniform(0.85, 1)},
                    {0.1, belly},
                    {shoulder, belly * random.uniform(0.92, 1)},
                    {shoulder + random.uniform(0.12, 0.2), neck},
                    {0.93, neck},
                    {0.95, neck * 1.25},
                    {1, neck * 1.25}},
          .wall = random.uniform(0.018, 0.03),
          .floor = random.uniform(0.03, 0.05)};
}

Plan jug(Random& random) {
  const double belly = random.uniform(0.28, 0.4), neck = belly * random.uniform(0.5, 0.75);
  Plan plan{.outer = {{0, belly * random.uniform(0.6, 0.8)},
                      {random.uniform(0.28, 0.42), belly},
                      {random.uniform(0.68, 0.8), neck},
                      {1, neck * random.uniform(1.1, 1.4)}},
            .wall = random.uniform(0.03, 0.045),
            .floor = random.uniform(0.04, 0.07)};
  plan.beak = random.uniform(0.25, 0.5);
  plan.handles = 1;
  plan.handle_low = random.uniform(0.3, 0.45);
  plan.handle_high = random.uniform(0.84, 0.94);
  plan.handle_reach = random.uniform(0.1, 0.2);
  return plan;
}

Plan amphora(Random& random) {
  const double belly = random.uniform(0.24, 0.32), neck = belly * random.uniform(0.3, 0.42);
  Plan plan{.outer = {{0, belly * random.uniform(0.3, 0.45)},
                      {0.05, belly * random.uniform(0.28, 0.4)},
                      {random.uniform(0.45, 0.58), belly},
                      {random.uniform(0.76, 0.82), neck},
                      {0.94, neck * 1.1},
                      {1, neck * random.uniform(1.3, 1.6)}},
            .wall = random.uniform(0.025, 0.035),
            .floor = random.uniform(0.05, 0.09)};
  plan.handles = 2;
  plan.handle_low = random.uniform(0.6, 0.68);
  plan.handle_high = random.uniform(0.88, 0.93);
  plan.handle_reach = random.uniform(0.02, 0.1);
  return plan;
}

Plan teapot(Random& random) {
  const double belly = random.uniform(0.5, 0.68), mouth = belly * random.uniform(0.4, 0.55);
  Plan plan{.outer = {{0, belly * random.uniform(0.5, 0.7)},
                      {random.uniform(0.35, 0.5), belly},
                      {0.93, mouth},
                      {1, mouth * 1.05}},
            .wall = random.uniform(0.04, 0.06),
            .floor = random.uniform(0.06, 0.1)};
  plan.spout = true;
  plan.handles = 1;
  plan.handle_low = random.uniform(0.2, 0.32);
  plan.handle_high = random.uniform(0.72, 0.82);
  plan.handle_reach = random.uniform(0.22, 0.36);
  return plan;
}

Plan goblet(Random& random) {
  const double rim = random.uniform(0.24, 0.36), stem = random.uniform(0.04, 0.06);
  const double cup = random.uniform(0.42, 0.52), foot = rim * random.uniform(0.75, 1.05);
  return {.outer = {{0, foot},
                    {0.03, foot},
                    {0.1, stem * 1.4},
                    {cup - 0.14, stem},
                    {cup + 0.1, rim * random.uniform(0.7, 0.95)},
                    {0.8, rim * random.uniform(0.95, 1.1)},
                    {1, rim}},
          .wall = random.uniform(0.02, 0.03),
          .floor = cup};
}

// A turned post or pawn, massive.
Plan post(Random& random) {
  const double foot = random.uniform(0.22, 0.34), waist = foot * random.uniform(0.3, 0.5);
  const double head = foot * random.uniform(0.5, 0.8);
  return {.outer = {{0, foot},
                    {0.1, foot * random.uniform(0.85, 1)},
                    {random.uniform(0.2, 0.4), foot * random.uniform(0.4, 0.7)},
                    {random.uniform(0.5, 0.64), waist},
                    {0.7, head * 0.8},
                    {0.82, head},
                    {1, head * random.uniform(0.2, 0.5)}},
          .solid = true};
}

double widest(const Profile& outer, double low, double high) {
  double radius = 0;
  for (const double at : even_steps(low, high, 20)) radius = std::max(radius, outer(at));
  return radius;
}

/// Towards `side` (±x), from the wall at one height to the wall at another.
Bow::Tube handle(const Plan& plan, const Profile& outer, double side, double half_in, double half_across) {
  const double out = widest(outer, plan.handle_low, plan.handle_high) + plan.handle_reach;
  const auto at = [&](double radius, double height) { return Vector3d(side * radius, 0, height); };
  // A cubic goes three quarters of the way to where its inner control points are.
  const auto inner = [&](double wall) { return (out - wall / 4) / 0.75; };
  const double high = outer(plan.handle_high) - plan.wall / 2, low = outer(plan.handle_low) - plan.wall / 2;
  const double spread = 0.12 * (plan.handle_high - plan.handle_low);
  return {.curve = {at(high, plan.handle_high), at(inner(high), plan.handle_high + spread),
                    at(inner(low), plan.handle_low + spread), at(low, plan.handle_low)},
          .across = Vector3d::UnitY(),
          .half_in = {half_in, half_in},
          .half_across = {half_across, half_across}};
}

/// Towards +x, from the belly up to the height of the rim.
Bow::Tube spout(const Profile& outer, Random& random) {
  const double low = random.uniform(0.25, 0.4), belly = outer(low);
  const double out = widest(outer, 0, 1) + random.uniform(0.35, 0.55), top = random.uniform(0.92, 1.02);
  const double root = random.uniform(0.12, 0.16), tip = root * random.uniform(0.4, 0.55);
  return {.curve = {Vector3d(0.75 * belly, 0, low), Vector3d(std::lerp(belly, out, 0.75), 0, low + 0.05),
                    Vector3d(std::lerp(belly, out, 0.6), 0, top - 0.1), Vector3d(out, 0, top)},
          .across = Vector3d::UnitY(),
          .half_in = {root, tip},
          .half_across = {root, tip}};
}

}  // namespace

std::unique_ptr<Shape> random_vessel(Random& random) {
  constexpr Plan (*plans[])(Random&) = {bowl, cup, vase, bottle, jug, amphora, teapot, goblet, post};
  const Plan plan = plans[random.below(std::size(plans))](random);
  const Profile outer(plan.outer);
  const double wall = plan.wall;
  const Vector3d up = Vector3d::UnitZ(), x = Vector3d::UnitX();
  auto vessel = std::make_unique<Compound>();

  const auto lip = [beak = plan.beak](double height) {
    const double rise = std::clamp((height - 0.75) / 0.25, 0.0, 1.0);
    return beak * rise * rise;
  };
  const int columns = plan.beak > 0 ? 64 : 40;
  vessel->add(std::make_unique<Loft>(
      up, x, Outline::round,
      [=](double height) {
        const double radius = outer(height);
        return Section{.half_u = radius, .half_v = radius, .beak = lip(height)};
      },
      even_steps(0, 1, 40), columns));
  if (!plan.solid)
    vessel->take_away(std::make_unique<Loft>(
        up, x, Outline::round,
        [=, floor = plan.floor](double height) {
          // The wall is measured along its normal, but where it leans far over.
          const double slope = outer.slope(height), lean = std::min(std::sqrt(1 + slope * slope), 2.5);
          const double above = std::min(1.0, (height - floor) / 0.12);
          const double rounding = std::sqrt(1 - 0.6 * (1 - above) * (1 - above));
          const double radius = std::max(outer(height) - wall * lean, 0.3 * wall) * rounding;
          return Section{.half_u = radius, .half_v = radius, .beak = lip(height)};
        },
        joined({even_steps(plan.floor, plan.floor + 0.12, 8), even_steps(plan.floor + 0.12, 1.1, 32)}),
        columns));

  const double half_in = random.uniform(0.8, 1.1) * std::max(wall, 0.028),
               half_across = half_in * random.uniform(1, 1.6);
  for (int i = 0; i < plan.handles; ++i)
    vessel->add(std::make_unique<Bow>(handle(plan, outer, i == 0 ? -1 : 1, half_in, half_across)));
  if (plan.spout) {
    Bow::Tube tube = spout(outer, random);
    vessel->add(std::make_unique<Bow>(tube));
    // The bore reaches from inside the cavity to beyond the tip.
    const Vector3d first = (tube.curve[1] - tube.curve[0]).normalized(),
                   last = (tube.curve[3] - tube.curve[2]).normalized();
    tube.curve[0] -= 0.15 * first;
    tube.curve[3] += 0.02 * last;
    for (auto* half : {&tube.half_in, &tube.half_across})
      for (double& size : *half) size -= 0.55 * wall;
    vessel->take_away(std::make_unique<Bow>(tube));
  }

  if (plan.handles == 1 || plan.spout || plan.beak > 0) {
    vessel->finish();
  } else {
    vessel->set_symmetry({.axis = {0, 0, 1}, .order = plan.handles == 2 ? 2u : 0u});
    vessel->finish(Vector3d(0, 0, 0.5));
  }
  return vessel;
}

}  // namespace bitr::generate
