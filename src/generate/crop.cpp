#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <limits>
#include <string>
#include <vector>

#include "core/select_rows.hpp"
#include "generate/pairs.hpp"
#include "generate/seeds.hpp"

namespace bitr {
namespace {

using Eigen::Vector3d;

constexpr ProtocolName protocol_names[] = {
    {Protocol::opposed, "opposed",
     "opposite ends of one direction, both with the share S: they overlap in 2S - 1"},
    {Protocol::complement, "complement", "the reference keeps the share S, the source the rest: no overlap"},
    {Protocol::independent, "independent",
     "a direction for each side, both with the share S: overlap by chance"},
};

/// Keeps what is at least `from` along a direction.
struct Cut {
  Vector3d direction;
  double from = -std::numeric_limits<double>::infinity();
  double along(const Vec3d& point) const { return direction.dot(Vector3d(point.data())); }
};

/// Keeps `count` points: those furthest along the direction.
Cut cut_to(const PointCloud& cloud, const Vector3d& direction, std::size_t count) {
  Cut cut{direction};
  if (count == cloud.size()) return cut;
  std::vector<double> along;
  along.reserve(cloud.size());
  for (const Vec3d& point : cloud.positions) along.push_back(cut.along(point));
  const auto last = along.begin() + static_cast<std::ptrdiff_t>(count - 1);
  std::nth_element(along.begin(), last, along.end(), std::greater());
  cut.from = *last;
  return cut;
}

/// The points that the cut keeps, `most` at most, and of equally far ones the first.
PointCloud cropped(const PointCloud& cloud, const Cut& cut, std::size_t most) {
  std::vector<std::size_t> rows;
  for (std::size_t i = 0; i < cloud.size() && rows.size() < most; ++i)
    if (!(cut.along(cloud.positions[i]) < cut.from)) rows.push_back(i);
  return select_rows(cloud, rows);
}

Vector3d random_direction(Random& random) {
  const auto rotation = random.rotation();
  return {rotation[0], rotation[3], rotation[6]};
}

Result<GeneratedPair> crop(const PointCloud& source, const PointCloud& reference,
                           const CropOptions& options) {
  if (const auto valid = generate::check(options); !valid) return tl::unexpected(valid.error());
  const bool same = &source == &reference, complement = options.protocol == Protocol::complement;
  for (const PointCloud* cloud : {&source, &reference})
    if (cloud->size() < 2)
      return fail(ErrorCode::invalid_argument, "a cloud of " + std::to_string(cloud->size()) +
                                                   " points cannot be cropped; at least 2 are needed");
  // A share such as 0.7 is a little less than it says.
  const auto share_of = [&](const PointCloud& cloud) {
    const auto share = static_cast<std::size_t>(options.share * static_cast<double>(cloud.size()) + 1e-6);
    return std::clamp<std::size_t>(share, 1, complement ? cloud.size() - 1 : cloud.size());
  };
  const std::size_t reference_count = share_of(reference);
  const std::size_t source_count = complement ? source.size() - share_of(source) : share_of(source);

  Random random = generate::random_for(options.seed, generate::Draw::cut);
  const Vector3d direction = random_direction(random);
  const Vector3d other = options.protocol == Protocol::independent ? random_direction(random) : -direction;
  Cut source_cut = cut_to(source, direction, source_count),
      reference_cut = cut_to(reference, other, reference_count);
  if (complement || (options.protocol == Protocol::opposed && options.share <= 0.5)) {
    // The other cut as seen from this side; where the two cross, both stop short of the middle.
    const double facing = -reference_cut.from;
    if (source_cut.from <= facing) {
      const double middle = (source_cut.from + facing) / 2;
      source_cut.from = std::nextafter(middle, 1e300);
      reference_cut.from = std::nextafter(-middle, 1e300);
    }
  }

  GeneratedPair pair;
  pair.source = cropped(source, source_cut, source_count);
  pair.reference = cropped(reference, reference_cut, reference_count);
  if (pair.source.positions.empty() || pair.reference.positions.empty())
    return fail(ErrorCode::invalid_argument,
                "the crop leaves no point: the cloud's points are all in one place");
  std::size_t both = 0, all = 0;
  for (const PointCloud* cloud : {&source, &reference}) {
    if (same && all > 0) break;
    all += cloud->size();
    for (const Vec3d& point : cloud->positions)
      both += source_cut.along(point) >= source_cut.from && reference_cut.along(point) >= reference_cut.from;
  }
  pair.overlap = static_cast<double>(both) / static_cast<double>(all);
  generate::separate(pair,
                     {.noise = options.noise,
                      .clip = options.clip,
                      .translation = options.translation,
                      .normals = options.normals},
                     options.seed);
  return pair;
}

}  // namespace

std::span<const ProtocolName> protocols() { return protocol_names; }

std::string_view name(Protocol protocol) {
  for (const ProtocolName& known : protocol_names)
    if (known.protocol == protocol) return known.name;
  return "unknown";
}

Result<Protocol> protocol_named(std::string_view name) {
  std::string known;
  for (const ProtocolName& protocol : protocol_names) {
    if (protocol.name == name) return protocol.protocol;
    known.append(known.empty() ? "" : ", ").append(protocol.name);
  }
  return fail(ErrorCode::invalid_argument, "unknown protocol \"" + std::string(name) + "\"; known: " + known);
}

Result<void> generate::check(const CropOptions& options) {
  const auto outside = [](const char* option, double value, const char* range) {
    return fail(ErrorCode::invalid_argument,
                std::string(option) + " is " + std::to_string(value) + ", not " + range);
  };
  if (!(options.share > 0 && options.share <= 1))
    return outside("share", options.share, "above 0 and up to 1");
  if (options.protocol == Protocol::complement && options.share == 1)
    return outside("share", 1, "below 1, which leaves the source nothing");
  if (!(options.noise >= 0 && std::isfinite(options.noise)))
    return outside("noise", options.noise, "0 or more");
  if (!(options.clip > 0)) return outside("clip", options.clip, "above 0");
  if (!(options.translation >= 0 && std::isfinite(options.translation)))
    return outside("translation", options.translation, "0 or more");
  return {};
}

Result<GeneratedPair> crop_pair(const PointCloud& cloud, const CropOptions& options) {
  return crop(cloud, cloud, options);
}

Result<GeneratedPair> crop_pair(const PointCloud& source, const PointCloud& reference,
                                const CropOptions& options) {
  return crop(source, reference, options);
}

}  // namespace bitr
