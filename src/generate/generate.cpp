#include <algorithm>
#include <bitr/generate.hpp>
#include <iterator>
#include <string>

#include "generate/aircraft.hpp"
#include "generate/pairs.hpp"
#include "generate/seeds.hpp"
#include "generate/solid.hpp"
#include "generate/vessels.hpp"

namespace bitr {
namespace generate {
namespace {

constexpr GeneratedKind kinds[] = {
    {"fragments", "a solid without symmetry, broken in two along a rough, curved surface"},
    {"copy", "a solid without symmetry, and a moved copy of exactly the same points"},
    {"vessels", "a pot, jug, cup or bottle, some with handles, broken in two"},
    {"aircraft", "an aeroplane, two samples cropped from opposite ends"},
};

constexpr ShapeKind makers[] = {
    {"solids", random_solid_shape, PairOrigin::broken},
    {"solids", random_solid_shape, PairOrigin::copied},
    {"vessels", random_vessel, PairOrigin::broken},
    {"aircraft", random_aircraft, PairOrigin::cropped},
};
static_assert(std::size(kinds) == std::size(makers));

constexpr GeneratedKind shapes[] = {
    {"solids", "a solid without symmetry"},
    {"vessels", "a pot, jug, cup or bottle, some with handles or a spout"},
    {"aircraft", "an aeroplane"},
};

/// The index of the one of that name.
Result<std::size_t> find(std::span<const GeneratedKind> among, std::string_view name) {
  std::string known;
  for (std::size_t i = 0; i < among.size(); ++i) {
    if (among[i].name == name) return i;
    known.append(known.empty() ? "" : ", ").append(among[i].name);
  }
  return fail(ErrorCode::invalid_argument, "unknown kind \"" + std::string(name) + "\"; known: " + known);
}

Result<void> check(const GenerateOptions& options) {
  if (const auto valid = check_points(options.points); !valid) return valid;
  if (!(options.noise >= 0 && options.noise <= 1))
    return fail(ErrorCode::invalid_argument, "noise is " + std::to_string(options.noise) + ", not in 0 … 1");
  if (!(options.roughness >= 0 && options.roughness <= 0.1))
    return fail(ErrorCode::invalid_argument,
                "roughness is " + std::to_string(options.roughness) + ", not in 0 … 0.1");
  return {};
}

}  // namespace

Result<const ShapeKind*> kind_named(std::string_view name) {
  const auto found = find(kinds, name);
  if (!found) return tl::unexpected(found.error());
  return &makers[*found];
}

std::unique_ptr<Shape> make_shape(const ShapeKind& kind, std::uint64_t seed) {
  Random random = random_for(seed, Draw::shape);
  return kind.make(random);
}

Result<void> check_points(std::size_t points) {
  if (points >= 1 && points <= max_generated_points) return {};
  return fail(ErrorCode::invalid_argument,
              "points is " + std::to_string(points) + ", not in 1 … " + std::to_string(max_generated_points));
}

}  // namespace generate

using namespace generate;

std::span<const GeneratedKind> generated_kinds() { return kinds; }
std::span<const GeneratedKind> generated_shapes() { return shapes; }

Result<GeneratedPair> generate_pair(std::string_view name, const GenerateOptions& options) {
  const auto kind = kind_named(name);
  if (!kind) return tl::unexpected(kind.error());
  if (const auto valid = check(options); !valid) return tl::unexpected(valid.error());
  const PairOrigin origin = (*kind)->origin;
  const auto shape = make_shape(**kind, options.seed);
  GeneratedPair pair;
  if (options.protocol || origin == PairOrigin::cropped) {
    const CropOptions crop{.protocol = options.protocol.value_or(Protocol::opposed),
                           .share = options.share,
                           .noise = options.noise,
                           .seed = options.seed};
    if (const auto valid = generate::check(crop); !valid) return tl::unexpected(valid.error());
    return sample_and_crop(*shape, options.points, origin == PairOrigin::copied, crop);
  }
  pair = origin == PairOrigin::broken ? break_in_two(*shape, options.points, options.roughness, options.seed)
                                      : sample_twice(*shape, options.points, true, options.seed);
  separate(pair, {.noise = options.noise}, options.seed);
  return pair;
}

Result<GeneratedShape> generate_shape(std::string_view name, std::uint64_t seed, std::size_t points) {
  const auto found = find(shapes, name);
  if (!found) return tl::unexpected(found.error());
  if (const auto valid = check_points(points); !valid) return tl::unexpected(valid.error());
  const auto kind =
      std::find_if(std::begin(makers), std::end(makers), [&](const ShapeKind& k) { return k.shape == name; });
  const auto shape = make_shape(*kind, seed);
  Random random = random_for(seed, Draw::points);
  return GeneratedShape{sample(*shape, points, random), shape->symmetry()};
}

}  // namespace bitr
