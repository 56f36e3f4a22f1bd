#include "generate/aircraft.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "generate/compound.hpp"

namespace bitr::generate {
namespace {

using Eigen::Vector3d;

// Everything is in units of the fuselage's length until the compound is finished: the nose is at x = 0, the
// tail at x = 1, z = 0 is the fuselage's middle.

const Vector3d forwards = -Vector3d::UnitX();

struct Fuselage {
  double radius;
  double height = 1;  ///< in units of the width
  double nose, tail;  ///< lengths
  double droop;       ///< how low the nose's tip is, in radii
  double upsweep;     ///< how high the tail's end is, in radii
  double tail_radius = 0.12;

  double shape(double x) const {
    if (x < nose) {
      const double back = 1 - x / nose;
      return std::pow(std::max(0.0, 1 - back * back), 0.6);
    }
    const double end = std::max(0.0, (x - (1 - tail)) / tail);
    return 1 - (1 - tail_radius) * std::pow(end, 1.6);
  }
  double middle(double x) const {
    if (x < nose) return -droop * radius * (1 - x / nose) * (1 - x / nose);
    const double end = std::max(0.0, (x - (1 - tail)) / tail);
    return upsweep * radius * std::pow(end, 1.6);
  }
  double top(double x) const { return middle(x) + radius * height * shape(x); }
  double side(double x) const { return radius * shape(x); }

  std::unique_ptr<Primitive> primitive() const {
    return std::make_unique<Loft>(
        Vector3d::UnitX(), Vector3d::UnitY(), Outline::round,
        [*this](double x) {
          const double size = radius * shape(x);
          return Section{.v = middle(x), .half_u = size, .half_v = size * height};
        },
        joined({steps_from_tip(0, nose, 12), even_steps(nose, 1 - tail, 8), even_steps(1 - tail, 1, 14)}),
        36);
  }
};

/// A wing or tailplane, both halves of it.
struct Wing {
  double x, z;  ///< the leading edge at y = 0
  double half_span;
  double root, tip;  ///< chords
  double sweep;      ///< how far back the leading edge goes per unit of span
  double dihedral;   ///< how far up
  double thickness;  ///< in units of the chord
  double kink = 0;   ///< share of the half span where the trailing edge bends; 0: nowhere
  double kink_chord = 0;

  double chord(double y) const {
    const double share = std::min(std::abs(y) / half_span, 1.0);
    if (kink == 0) return std::lerp(root, tip, share);
    return share < kink ? std::lerp(root, kink_chord, share / kink)
                        : std::lerp(kink_chord, tip, (share - kink) / (1 - kink));
  }
  double leading_edge(double y) const { return x + sweep * std::abs(y); }
  double height(double y) const { return z + dihedral * std::abs(y); }

  std::unique_ptr<Primitive> primitive() const {
    const double bend = kink == 0 ? half_span / 2 : kink * half_span;
    return std::make_unique<Loft>(
        Vector3d::UnitY(), forwards, Outline::airfoil,
        [*this](double y) {
          // The tip is rounded off over its last few percent.
          const double end = std::max(0.0, (std::abs(y) / half_span - 0.96) / 0.04);
          const double size = chord(y) * std::sqrt(1 - 0.75 * std::min(1.0, end * end));
          const double outwards = 1 - 0.25 * std::min(1.0, std::abs(y) / half_span);
          return Section{.u = -(leading_edge(y) + chord(y) / 2),
                         .v = height(y),
                         .half_u = size / 2,
                         .half_v = size * thickness * outwards / 2};
        },
        joined({even_steps(-half_span, -0.96 * half_span, 3), even_steps(-0.96 * half_span, -bend, 6),
                even_steps(-bend, 0, 4), even_steps(0, bend, 4), even_steps(bend, 0.96 * half_span, 6),
                even_steps(0.96 * half_span, half_span, 3)}),
        28);
  }
};

/// A thin lofted plate away from a place along any direction across the x axis: fins, winglets, pylons.
struct Plate {
  Vector3d from;       ///< the root's leading edge
  Vector3d direction;  ///< unit vector with no x
  double length;
  double root, tip;  ///< chords
  double sweep;
  double thickness;

  std::unique_ptr<Primitive> primitive() const {
    const double start = direction.dot(from), aside = direction.cross(forwards).dot(from);
    return std::make_unique<Loft>(
        direction, forwards, Outline::airfoil,
        [*this, start, aside](double along) {
          const double share = (along - start) / length, chord = std::lerp(root, tip, share);
          const double end = std::max(0.0, (share - 0.94) / 0.06);
          const double size = chord * std::sqrt(1 - 0.6 * std::min(1.0, end * end));
          return Section{.u = -(from.x() + sweep * (along - start) + chord / 2),
                         .v = aside,
                         .half_u = size / 2,
                         .half_v = size * thickness / 2};
        },
        joined({even_steps(start, start + 0.94 * length, 7),
                even_steps(start + 0.94 * length, start + length, 3)}),
        24);
  }
};

/// A body along x with a round section, open in front and, with an exhaust, behind.
struct Nacelle {
  Vector3d front;  ///< middle of its front
  double length, radius;
  double lip = 0.86, end = 0.6;  ///< radii of both ends, in units of the radius
  double height = 1;             ///< in units of the width
  double intake = 0.35;          ///< depth of the opening, in units of the length; 0: closed

  Loft::Cut cut(double inset) const {
    return [*this, inset](double x) {
      const double share = std::clamp((x - front.x()) / length, 0.0, 1.0);
      const double forward = std::max(0.0, 1 - share / 0.25), back = std::max(0.0, (share - 0.35) / 0.65);
      const double size = radius * (1 - (1 - lip) * forward * forward - (1 - end) * back * back) - inset;
      return Section{.u = front.y(), .v = front.z(), .half_u = size, .half_v = size * height};
    };
  }
  void add_to(Compound& aircraft) const {
    const double first = front.x(), last = first + length;
    const auto loft = [&](double inset, const std::vector<double>& stations) {
      return std::make_unique<Loft>(Vector3d::UnitX(), Vector3d::UnitY(), Outline::round, cut(inset),
                                    stations, 20);
    };
    aircraft.add(
        loft(0, joined({even_steps(first, first + length / 4, 4), even_steps(first + length / 4, last, 8)})));
    if (intake == 0) return;
    aircraft.take_away(loft(0.1 * radius, even_steps(first - 0.1 * length, first + intake * length, 5)));
    aircraft.take_away(loft(0.08 * radius, even_steps(last - 0.12 * length, last + 0.1 * length, 3)));
  }
};

/// A body along x with a round nose and a long tail: canopies, propeller nacelles, fairings.
struct Blister {
  Vector3d middle, half;
  double fullest = 0.4;  ///< share of its length where it is widest
  double blunt = 0.5;    ///< 0.5: an ellipsoid's ends; more: sharper

  std::unique_ptr<Primitive> primitive() const {
    const double first = middle.x() - half.x(), last = middle.x() + half.x(),
                 top = std::lerp(first, last, fullest);
    std::vector<double> back = steps_from_tip(0, 1, 8);
    std::vector<double> stations = steps_from_tip(first, top, 8);
    for (auto step = back.rbegin() + 1; step != back.rend(); ++step)
      stations.push_back(std::lerp(last, top, *step));
    return std::make_unique<Loft>(
        Vector3d::UnitX(), Vector3d::UnitY(), Outline::round,
        [*this, first, last, top](double x) {
          const double share = x < top ? (top - x) / (top - first) : (x - top) / (last - top);
          const double size = std::pow(std::max(0.0, 1 - share * share), blunt);
          return Section{
              .u = middle.y(), .v = middle.z(), .half_u = half.y() * size, .half_v = half.z() * size};
        },
        stations, 20);
  }
};

void mirrored(Compound& aircraft, Plate plate) {
  aircraft.add(plate.primitive());
  plate.from.y() *= -1;
  plate.direction.y() *= -1;
  aircraft.add(plate.primitive());
}

void mirrored(Compound& aircraft, Nacelle nacelle) {
  nacelle.add_to(aircraft);
  nacelle.front.y() *= -1;
  nacelle.add_to(aircraft);
}

void mirrored(Compound& aircraft, Blister blister) {
  aircraft.add(blister.primitive());
  blister.middle.y() *= -1;
  aircraft.add(blister.primitive());
}

Vector3d upright(double cant) { return {0, std::sin(cant), std::cos(cant)}; }

enum class Tail { low, cross, tee, vee };

/// A fin and a tailplane of the given sizes at the end of the fuselage.
void add_tail(Compound& aircraft, const Fuselage& body, Tail tail, double fin_height, double half_span,
              double sweep, Random& random) {
  const double root = fin_height * random.uniform(0.95, 1.25), tip = root * random.uniform(0.35, 0.55);
  const double x = 0.97 - root, plane_root = half_span * random.uniform(0.5, 0.65);
  const double plane_tip = plane_root * random.uniform(0.4, 0.7);
  if (tail == Tail::vee) {
    const double cant = random.uniform(0.75, 0.95);
    mirrored(aircraft, Plate{.from = {0.97 - plane_root * 1.2, 0, body.middle(0.93)},
                             .direction = upright(cant),
                             .length = 1.25 * half_span,
                             .root = plane_root * 1.2,
                             .tip = plane_tip,
                             .sweep = 0.6 * sweep,
                             .thickness = 0.1});
    return;
  }
  const double fin_sweep = sweep + (root - tip) / fin_height * 0.25, base = body.middle(x + root / 2);
  const double height = body.top(x + root / 2) - base + fin_height;
  aircraft.add(Plate{.from = {x, 0, base},
                     .direction = Vector3d::UnitZ(),
                     .length = height,
                     .root = root * 1.15,
                     .tip = tip,
                     .sweep = fin_sweep,
                     .thickness = 0.11}
                   .primitive());
  const double up = tail == Tail::low ? 0 : tail == Tail::tee ? 0.96 : random.uniform(0.4, 0.6);
  // On the fin it sits where the fin is there; else at the fuselage's end.
  const double plane_x = tail == Tail::low ? 0.96 - plane_root - 0.3 * sweep * half_span
                                           : x + fin_sweep * up * height - 0.1 * plane_root;
  aircraft.add(Wing{.x = plane_x,
                    .z = tail == Tail::low ? body.middle(plane_x + plane_root / 2) + 0.15 * body.radius
                                           : base + up * height,
                    .half_span = half_span,
                    .root = plane_root,
                    .tip = plane_tip,
                    .sweep = sweep * random.uniform(0.8, 1.05),
                    .dihedral = tail == Tail::low ? random.uniform(0, 0.12) : 0,
                    .thickness = 0.09}
                   .primitive());
}

void add_winglets(Compound& aircraft, const Wing& wing, Random& random) {
  const double y = 0.99 * wing.half_span, length = random.uniform(0.04, 0.075);
  mirrored(aircraft, Plate{.from = {wing.leading_edge(y) + 0.1 * wing.tip, y, wing.height(y)},
                           .direction = upright(random.uniform(0.1, 0.5)),
                           .length = length,
                           .root = 0.85 * wing.tip,
                           .tip = 0.4 * wing.tip,
                           .sweep = random.uniform(0.5, 0.9),
                           .thickness = 0.09});
}

/// Jet engines under the wing, a share of the half span out, on pylons.
void add_wing_engine(Compound& aircraft, const Wing& wing, double out, double radius, double length) {
  const double y = out * wing.half_span, edge = wing.leading_edge(y), below = wing.height(y) - 1.25 * radius;
  mirrored(aircraft, Nacelle{.front = {edge - 0.62 * length, y, below}, .length = length, .radius = radius});
  mirrored(aircraft, Plate{.from = {edge - 0.3 * length, y, below},
                           .direction = Vector3d::UnitZ(),
                           .length = wing.height(y) - below + 0.01 * wing.thickness,
                           .root = 0.8 * length,
                           .tip = 0.8 * length,
                           .sweep = 0.3,
                           .thickness = 0.09});
}

/// A pair of jet engines at the sides of the fuselage's tail.
void add_tail_engines(Compound& aircraft, const Fuselage& body, double radius, double length,
                      Random& random) {
  const double x = random.uniform(0.64, 0.7), z = body.middle(x) + random.uniform(0.3, 0.6) * body.radius;
  const double y = body.side(x + length / 2) + 1.15 * radius;
  mirrored(aircraft, Nacelle{.front = {x, y, z}, .length = length, .radius = radius});
  mirrored(aircraft, Plate{.from = {x + 0.25 * length, 0, z},
                           .direction = Vector3d::UnitY(),
                           .length = y,
                           .root = 0.55 * length,
                           .tip = 0.55 * length,
                           .sweep = 0,
                           .thickness = 0.12});
}

void airliner(Compound& aircraft, Random& random) {
  const Fuselage body{.radius = random.uniform(0.048, 0.072),
                      .height = random.uniform(0.95, 1.15),
                      .nose = random.uniform(0.1, 0.15),
                      .tail = random.uniform(0.28, 0.36),
                      .droop = random.uniform(0.1, 0.35),
                      .upsweep = random.uniform(0.5, 0.8)};
  aircraft.add(body.primitive());
  const double half_span = random.uniform(0.4, 0.54), root = random.uniform(0.2, 0.26);
  const bool high = random.uniform() < 0.15;
  const Wing wing{.x = random.uniform(0.31, 0.38),
                  .z = (high ? 0.75 : -0.6) * body.radius,
                  .half_span = half_span,
                  .root = root,
                  .tip = root * random.uniform(0.2, 0.32),
                  .sweep = random.uniform(0.4, 0.65),
                  .dihedral = high ? random.uniform(-0.06, 0) : random.uniform(0.05, 0.13),
                  .thickness = random.uniform(0.11, 0.13),
                  .kink = random.uniform(0.3, 0.4),
                  .kink_chord = root * random.uniform(0.56, 0.66)};
  aircraft.add(wing.primitive());
  aircraft.add(Blister{.middle = {wing.x + 0.55 * root, 0, (high ? 0.5 : -0.62) * body.radius},
                       .half = {0.8 * root, 1.02 * body.radius, 0.55 * body.radius}}
                   .primitive());
  const std::uint64_t layout = random.below(10);  // engines: 6 of 10 two, 2 four, 2 at the tail
  const double radius = body.radius * random.uniform(0.42, 0.62), length = radius * random.uniform(3, 4);
  if (layout < 6) {
    add_wing_engine(aircraft, wing, random.uniform(0.3, 0.38), radius, length);
  } else if (layout < 8) {
    add_wing_engine(aircraft, wing, random.uniform(0.3, 0.36), 0.8 * radius, 0.8 * length);
    add_wing_engine(aircraft, wing, random.uniform(0.58, 0.68), 0.8 * radius, 0.8 * length);
  } else {
    add_tail_engines(aircraft, body, 0.9 * radius, length, random);
  }
  const Tail tail = layout >= 8 || (high && random.uniform() < 0.7) ? Tail::tee : Tail::low;
  add_tail(aircraft, body, tail, random.uniform(0.13, 0.18), half_span * random.uniform(0.34, 0.42),
           random.uniform(0.5, 0.75), random);
  if (random.uniform() < 0.5) add_winglets(aircraft, wing, random);
}

void turboprop(Compound& aircraft, Random& random) {
  const Fuselage body{.radius = random.uniform(0.052, 0.07),
                      .nose = random.uniform(0.12, 0.17),
                      .tail = random.uniform(0.32, 0.4),
                      .droop = random.uniform(0.2, 0.4),
                      .upsweep = random.uniform(0.6, 0.85)};
  aircraft.add(body.primitive());
  const double root = random.uniform(0.12, 0.16);
  const bool high = random.uniform() < 0.75;
  const Wing wing{.x = random.uniform(0.36, 0.44),
                  .z = (high ? 0.95 : -0.7) * body.radius,
                  .half_span = random.uniform(0.5, 0.64),
                  .root = root,
                  .tip = root * random.uniform(0.4, 0.6),
                  .sweep = random.uniform(0, 0.08),
                  .dihedral = random.uniform(0, 0.06),
                  .thickness = random.uniform(0.13, 0.16)};
  aircraft.add(wing.primitive());
  const int engines = random.uniform() < 0.75 ? 1 : 2;  // on each side
  const double radius = random.uniform(0.022, 0.03);
  for (int i = 0; i < engines; ++i) {
    const double y = (engines == 1 ? random.uniform(0.3, 0.38) : 0.27 + 0.28 * i) * wing.half_span;
    const double chord = wing.chord(y), edge = wing.leading_edge(y);
    mirrored(aircraft, Blister{.middle = {edge + 0.15 * chord, y, wing.height(y) - 0.25 * radius},
                               .half = {0.9 * chord, radius, 1.2 * radius},
                               .fullest = 0.3});
    // Spinner and blades.
    const double front = edge - 0.68 * chord;
    mirrored(aircraft, Blister{.middle = {front, y, wing.height(y) - 0.25 * radius},
                               .half = {0.9 * radius, 0.4 * radius, 0.4 * radius},
                               .fullest = 0.7});
    const double turn = random.uniform(0, 1.5);
    for (int blade = 0; blade < 4; ++blade)
      mirrored(aircraft, Plate{.from = {front - 0.15 * radius, y, wing.height(y) - 0.25 * radius},
                               .direction = upright(turn + std::numbers::pi / 2 * blade),
                               .length = 3 * radius,
                               .root = 0.35 * radius,
                               .tip = 0.3 * radius,
                               .sweep = 0,
                               .thickness = 0.4});
  }
  const Tail tail = random.uniform() < 0.55 ? Tail::tee : random.uniform() < 0.5 ? Tail::cross : Tail::low;
  add_tail(aircraft, body, tail, random.uniform(0.14, 0.19), wing.half_span * random.uniform(0.28, 0.36),
           random.uniform(0.1, 0.4), random);
}

void business_jet(Compound& aircraft, Random& random) {
  const Fuselage body{.radius = random.uniform(0.056, 0.075),
                      .nose = random.uniform(0.2, 0.27),
                      .tail = random.uniform(0.34, 0.42),
                      .droop = random.uniform(0.2, 0.5),
                      .upsweep = random.uniform(0.4, 0.7)};
  aircraft.add(body.primitive());
  const double root = random.uniform(0.18, 0.26);
  const Wing wing{.x = random.uniform(0.4, 0.46),
                  .z = -0.75 * body.radius,
                  .half_span = random.uniform(0.4, 0.54),
                  .root = root,
                  .tip = root * random.uniform(0.28, 0.42),
                  .sweep = random.uniform(0.2, 0.55),
                  .dihedral = random.uniform(0.03, 0.1),
                  .thickness = random.uniform(0.11, 0.13)};
  aircraft.add(wing.primitive());
  const double radius = body.radius * random.uniform(0.42, 0.55), length = radius * random.uniform(4, 5.2);
  add_tail_engines(aircraft, body, radius, length, random);
  if (random.uniform() < 0.2)  // the third one, at the root of the fin
    Nacelle{.front = {0.7, 0, body.top(0.72) + 0.5 * radius}, .length = 1.3 * length, .radius = radius}
        .add_to(aircraft);
  add_tail(aircraft, body, random.uniform() < 0.75 ? Tail::tee : Tail::cross, random.uniform(0.13, 0.17),
           random.uniform(0.14, 0.19), random.uniform(0.4, 0.8), random);
  if (random.uniform() < 0.6) add_winglets(aircraft, wing, random);
}

void light_aeroplane(Compound& aircraft, Random& random) {
  const Fuselage body{.radius = random.uniform(0.06, 0.08),
                      .height = random.uniform(1.1, 1.3),
                      .nose = random.uniform(0.1, 0.16),
                      .tail = random.uniform(0.5, 0.6),
                      .droop = random.uniform(0.2, 0.4),
                      .upsweep = random.uniform(0.2, 0.5),
                      .tail_radius = 0.2};
  aircraft.add(body.primitive());
  const bool high = random.uniform() < 0.5;
  const double root = random.uniform(0.17, 0.23);
  const Wing wing{.x = random.uniform(0.24, 0.3),
                  .z = high ? body.radius * body.height + 0.03 : -0.7 * body.radius,
                  .half_span = random.uniform(0.6, 0.75),
                  .root = root,
                  .tip = root * random.uniform(0.6, 1),
                  .sweep = random.uniform(0, 0.06),
                  .dihedral = random.uniform(0.02, 0.1),
                  .thickness = random.uniform(0.12, 0.15)};
  aircraft.add(wing.primitive());
  aircraft.add(Blister{.middle = {wing.x + 0.5 * root, 0, 0.7 * body.radius * body.height},
                       .half = {random.uniform(0.15, 0.2), 0.85 * body.radius, high ? 0.06 : 0.055},
                       .fullest = 0.4}
                   .primitive());
  if (high) {  // the struts
    const double y = 0.45 * wing.half_span, rise = wing.height(y) + 0.6 * body.radius;
    mirrored(aircraft, Plate{.from = {wing.x + 0.2 * root, 0.6 * body.radius, -0.6 * body.radius},
                             .direction = Vector3d(0, y - 0.6 * body.radius, rise).normalized(),
                             .length = std::hypot(y - 0.6 * body.radius, rise),
                             .root = 0.025,
                             .tip = 0.025,
                             .sweep = 0.03,
                             .thickness = 0.35});
  }
  if (random.uniform() < 0.25) {  // two engines on the wing in place of the one in the nose
    const double y = random.uniform(0.26, 0.32) * wing.half_span;
    mirrored(aircraft, Blister{.middle = {wing.leading_edge(y) + 0.1 * root, y, wing.height(y)},
                               .half = {0.8 * root, 0.036, 0.04},
                               .fullest = 0.3});
  } else {
    aircraft.add(Blister{.middle = {0.0, 0, body.middle(0.01)}, .half = {0.03, 0.018, 0.018}, .fullest = 0.7}
                     .primitive());
    const double turn = random.uniform(0, 3);
    for (int blade = 0; blade < 2; ++blade)
      aircraft.add(Plate{.from = {-0.012, 0, body.middle(0)},
                         .direction = upright(turn + std::numbers::pi * blade),
                         .length = random.uniform(0.11, 0.13),
                         .root = 0.02,
                         .tip = 0.016,
                         .sweep = 0,
                         .thickness = 0.3}
                       .primitive());
  }
  add_tail(aircraft, body, random.uniform() < 0.85 ? Tail::low : Tail::tee, random.uniform(0.13, 0.17),
           random.uniform(0.19, 0.25), random.uniform(0.05, 0.3), random);
}

void glider(Compound& aircraft, Random& random) {
  const Fuselage body{.radius = random.uniform(0.042, 0.055),
                      .height = random.uniform(1.1, 1.3),
                      .nose = random.uniform(0.22, 0.3),
                      .tail = random.uniform(0.58, 0.66),
                      .droop = random.uniform(0.1, 0.4),
                      .upsweep = random.uniform(0.2, 0.5),
                      .tail_radius = 0.25};
  aircraft.add(body.primitive());
  const double root = random.uniform(0.1, 0.14);
  const Wing wing{.x = random.uniform(0.3, 0.36),
                  .z = random.uniform(0.2, 0.8) * body.radius,
                  .half_span = random.uniform(0.85, 1.15),
                  .root = root,
                  .tip = root * random.uniform(0.3, 0.5),
                  .sweep = random.uniform(0, 0.04),
                  .dihedral = random.uniform(0.03, 0.09),
                  .thickness = random.uniform(0.13, 0.16)};
  aircraft.add(wing.primitive());
  aircraft.add(Blister{.middle = {0.19, 0, 0.55 * body.radius},
                       .half = {random.uniform(0.1, 0.13), 0.75 * body.radius, 0.8 * body.radius}}
                   .primitive());
  const double kind = random.uniform();
  add_tail(aircraft, body,
           kind < 0.6   ? Tail::tee
           : kind < 0.8 ? Tail::low
                        : Tail::vee,
           random.uniform(0.12, 0.16), random.uniform(0.14, 0.19), random.uniform(0.05, 0.25), random);
}

void fighter(Compound& aircraft, Random& random) {
  const Fuselage body{.radius = random.uniform(0.048, 0.06),
                      .height = random.uniform(0.9, 1.1),
                      .nose = random.uniform(0.32, 0.42),
                      .tail = random.uniform(0.15, 0.25),
                      .droop = random.uniform(0, 0.5),
                      .upsweep = random.uniform(0, 0.15),
                      .tail_radius = random.uniform(0.6, 0.8)};
  aircraft.add(body.primitive());
  aircraft.add(Blister{.middle = {random.uniform(0.28, 0.32), 0, 0.75 * body.radius},
                       .half = {random.uniform(0.12, 0.15), 0.55 * body.radius, 0.85 * body.radius},
                       .fullest = 0.35}
                   .primitive());
  // Intakes at both sides run into the engines at the tail.
  const double size = body.radius * random.uniform(0.75, 0.95), start = random.uniform(0.34, 0.42);
  const double apart = body.radius * random.uniform(0.75, 1.1), below = -random.uniform(0, 0.3) * body.radius;
  mirrored(aircraft, Nacelle{.front = {start, apart, below},
                             .length = random.uniform(1.0, 1.04) - start,
                             .radius = size,
                             .lip = 0.95,
                             .end = random.uniform(0.7, 0.85),
                             .height = random.uniform(0.9, 1.1),
                             .intake = 0.15});
  const bool delta = random.uniform() < 0.5;
  const double root = delta ? random.uniform(0.44, 0.54) : random.uniform(0.28, 0.36);
  const Wing wing{.x = (delta ? 0.93 : random.uniform(0.76, 0.82)) - root,
                  .z = random.uniform(-0.2, 0.3) * body.radius,
                  .half_span = random.uniform(0.28, 0.36),
                  .root = root,
                  .tip = root * (delta ? random.uniform(0.06, 0.14) : random.uniform(0.2, 0.34)),
                  .sweep = delta ? random.uniform(1.1, 1.35) : random.uniform(0.55, 0.85),
                  .dihedral = random.uniform(-0.06, 0.03),
                  .thickness = random.uniform(0.05, 0.065)};
  aircraft.add(wing.primitive());
  const double sweep = random.uniform(0.6, 0.9), plane = random.uniform(0.1, 0.14);
  // Tailplanes behind a swept wing, canards before a delta.
  if (!delta || random.uniform() < 0.6)
    aircraft.add(Wing{.x = delta ? random.uniform(0.3, 0.34) : random.uniform(0.82, 0.86),
                      .z = delta ? 0.35 * body.radius : -0.1 * body.radius,
                      .half_span = wing.half_span * (delta ? 0.5 : 0.62),
                      .root = delta ? plane : 1.3 * plane,
                      .tip = 0.4 * plane,
                      .sweep = sweep,
                      .dihedral = 0,
                      .thickness = 0.05}
                     .primitive());
  const double height = random.uniform(0.13, 0.17), fin = height * random.uniform(1.1, 1.4);
  const Plate tail{.from = {0.95 - fin, 0, 0.5 * body.radius},
                   .direction = Vector3d::UnitZ(),
                   .length = height + 0.4 * body.radius,
                   .root = fin,
                   .tip = 0.35 * fin,
                   .sweep = random.uniform(0.7, 0.95),
                   .thickness = 0.06};
  if (random.uniform() < 0.5) {
    aircraft.add(tail.primitive());
  } else {
    Plate twin = tail;
    twin.from.y() = apart;
    twin.direction = upright(random.uniform(0, 0.45));
    twin.from.z() = below + 0.6 * size;
    mirrored(aircraft, twin);
  }
}

}  // namespace

std::unique_ptr<Shape> random_aircraft(Random& random) {
  constexpr void (*classes[])(Compound&, Random&) = {airliner,        airliner, turboprop, business_jet,
                                                     light_aeroplane, glider,   fighter};
  auto aircraft = std::make_unique<Compound>();
  classes[random.below(std::size(classes))](*aircraft, random);
  aircraft->finish();
  return aircraft;
}

}  // namespace bitr::generate
