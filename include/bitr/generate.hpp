// Procedural shapes, and pairs of clouds with a known answer, for examples, tests, benchmarks and training.
// Everything repeats for its seed: bit for bit with the same build, to rounding (1e-12) with any other.
#pragma once

#include <bitr/cloud.hpp>
#include <bitr/pose.hpp>
#include <bitr/result.hpp>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

namespace bitr {

/// How two clouds are cut from one object. A side is cut by a plane and keeps the share of the object's
/// points that is nearest to its own end of the plane's normal.
enum class Protocol {
  opposed,  ///< opposite ends of one random direction, both keep s: they overlap in 2s − 1, or not at all
  complement,   ///< the reference keeps s, the source the other 1 − s: they only meet
  independent,  ///< a random direction for each side, both keep s: they overlap by chance
};

struct ProtocolName {
  Protocol protocol;
  std::string_view name;
  std::string_view summary;  ///< one line
};

/// Every protocol.
std::span<const ProtocolName> protocols();
std::string_view name(Protocol protocol);
/// `invalid_argument` when there is none of that name.
Result<Protocol> protocol_named(std::string_view name);

/// Lengths are in model units: every generated object fits in a ball of radius 0.5.
struct GenerateOptions {
  std::size_t points = 2048;  ///< in each cloud, 1 … max_generated_points; where the object is cropped, in
                              ///< the whole object, of which each cloud keeps its share
  double noise = 0;  ///< standard deviation added to every coordinate, 0 … 1; clipped at noise_clip of it
  double roughness = 0.02;                ///< standard deviation of a break's relief, 0 … 0.1
  std::uint64_t seed = 0;                 ///< same seed, same shape and poses; same options, same points
  std::optional<Protocol> protocol = {};  ///< crop the whole object; empty: the kind's own way
  double share = 0.7;                     ///< s of the protocol, above 0 and up to 1
};

inline constexpr std::size_t max_generated_points = 10'000'000;
/// Noise stops at this many standard deviations.
inline constexpr double noise_clip = 5;

/// The rotations that map a shape to itself: turns about an axis through the origin of its own frame.
struct Symmetry {
  Vec3d axis = {0, 0, 1};   ///< unit vector
  std::uint32_t order = 1;  ///< turns by 360°/order; 1: none but the identity; 0: by any angle
};

/// Two clouds, each in a random frame of its own, and the motion that joins them.
struct GeneratedPair {
  PointCloud source;
  PointCloud reference;
  Pose T_reference_source;
  Pose T_source_object;  ///< from the frame of the whole object to the source's
  double overlap =
      0;  ///< the truth: share of the object's points in the part both clouds cover; 1 for a copy
  Symmetry symmetry = {};  ///< the whole object's, though a break or equal points may tell its turns apart
};

struct GeneratedKind {
  std::string_view name;
  std::string_view summary;  ///< one line
};

/// What generate_pair can make.
std::span<const GeneratedKind> generated_kinds();

/// `invalid_argument` when the kind is unknown or an option is out of its range.
Result<GeneratedPair> generate_pair(std::string_view kind, const GenerateOptions& options = {});

/// A whole object in a frame of its own, centred at the origin.
struct GeneratedShape {
  PointCloud cloud;  ///< uniform by area over the outer surface, with outward unit normals
  Symmetry symmetry;
};

/// What generate_shape can make: "solids" (without symmetry), "aircraft" (fuselage along x, nose at -x, z
/// up), "vessels" (z up).
std::span<const GeneratedKind> generated_shapes();

/// Same kind and seed, same shape; aircraft and vessels are those of generate_pair. `invalid_argument` when
/// the kind is unknown or `points` is not in 1 … max_generated_points.
Result<GeneratedShape> generate_shape(std::string_view kind, std::uint64_t seed, std::size_t points);

struct CropOptions {
  Protocol protocol = Protocol::opposed;
  double share = 0.7;        ///< s of the protocol, above 0 and up to 1
  double noise = 0;          ///< standard deviation added to every coordinate, in the cloud's units
  double clip = noise_clip;  ///< no coordinate moves further than this many standard deviations
  double translation = 1;    ///< both clouds are moved by ±translation at most along each axis, …
  bool normals = true;       ///< keep the cloud's, if it has any
  std::uint64_t seed = 0;    ///< same seed, same planes, poses and noise
};

/// Two crops of a cloud, each turned by a random rotation (uniform) and moved; overlap is the share of the
/// cloud's points that both kept. A side keeps floor(s · points), at least 1. `invalid_argument` when an
/// option is out of its range or the cloud has less than 2 points.
Result<GeneratedPair> crop_pair(const PointCloud& cloud, const CropOptions& options = {});

/// The same of two samples of one object, given in the same frame, so that no point is in both. Where the
/// protocol promises no overlap but the samples' cuts cross, both sides give up the few points beyond the
/// middle of the two cuts.
Result<GeneratedPair> crop_pair(const PointCloud& source, const PointCloud& reference,
                                const CropOptions& options);

}  // namespace bitr
