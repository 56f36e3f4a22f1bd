// STL, text and binary: triangles without shared vertices. Exactly equal corners are welded, so that the
// cloud of a mesh has each vertex once. Facet normals are ignored: the corners give them.
#include <algorithm>
#include <limits>
#include <numeric>

#include "io/cloud_builder.hpp"
#include "io/lines.hpp"
#include "io/mover.hpp"
#include "io/scalar.hpp"

namespace bitr::io {
namespace {

constexpr std::size_t header_bytes = 84, facet_bytes = 50;

// Corners in file order in, mesh out. Vertices keep the order of their first appearance. Sorting rather than
// hashing: no file can make it slow.
Result<Geometry> weld(const File& file, const std::vector<Vec3d>& corners) {
  if (corners.size() > std::numeric_limits<std::uint32_t>::max())
    return refuse(ErrorCode::unsupported, file, corners.size(), " corners; the limit is 2^32 - 1");
  std::vector<std::uint32_t> order(corners.size());
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return corners[a] != corners[b] ? corners[a] < corners[b] : a < b;
  });
  std::vector<std::uint32_t> first(corners.size());
  for (std::size_t i = 0; i < order.size(); ++i) {
    const bool repeats = i > 0 && corners[order[i]] == corners[order[i - 1]];
    first[order[i]] = repeats ? first[order[i - 1]] : order[i];
  }
  PointCloud cloud;
  std::vector<std::array<std::uint32_t, 3>> triangles(corners.size() / 3);
  std::vector<std::uint32_t>& vertex = order;  // its sorted content is used up
  for (std::size_t i = 0; i < corners.size(); ++i) {
    if (first[i] == i) {
      vertex[i] = static_cast<std::uint32_t>(cloud.positions.size());
      cloud.positions.push_back(corners[i]);
    } else {
      vertex[i] = vertex[first[i]];
    }
    triangles[i / 3][i % 3] = vertex[i];
  }
  if (triangles.empty()) return refuse(ErrorCode::bad_file, file, "no triangles");
  Geometry geometry;
  geometry.mesh = {cloud.positions, std::move(triangles)};
  geometry.cloud = std::move(cloud);
  return geometry;
}

Result<void> check_finite(const File& file, Place place, const Vec3d& corner) {
  for (const double value : corner) {
    if (!std::isfinite(value))
      return bad(file, place, "a corner has ", value, "; coordinates must be finite");
  }
  return {};
}

// Three numbers in bytes: a corner, or with role_nx a facet's normal.
Result<void> move_triple(const File& file, int role, std::size_t offset) {
  if (!file.mover) return {};
  for (int i = 0; i < 3; ++i)
    file.mover->number(role + i, ScalarType::f32, &file.bytes[offset + 4 * static_cast<std::size_t>(i)]);
  return file.mover->end_row(file, Place::byte(offset));
}

// The rest of a line that begins with "facet".
Result<void> move_normal(const File& file, Place place, Words words) {
  if (!file.mover || words.next() != "normal") return {};
  for (int i = 0; i < 3; ++i) {
    const std::string_view word = words.next();
    double value = 0;
    if (!parse_number(word, value))
      return bad(file, place, "a normal has ", in_quotes(word), ", not a number");
    file.mover->word(role_nx + i, word, value);
  }
  return file.mover->end_row(file, place);
}

Result<Geometry> parse_binary(const File& file) {
  const auto& bytes = file.bytes;
  if (bytes.size() < header_bytes)
    return bad(file, Place::byte(bytes.size()), "an STL file has at least ", header_bytes, " bytes");
  const std::uint64_t count = load<std::uint32_t>(&bytes[80]);
  const std::size_t remaining = bytes.size() - header_bytes;
  if (count > remaining / facet_bytes) {
    return bad(file, Place::byte(80), count, " triangles need ", product(count, facet_bytes), " bytes, ",
               remaining, " remain");
  }
  std::vector<Vec3d> corners;
  corners.reserve(3 * count);
  for (std::uint64_t i = 0; i < count; ++i) {
    const std::size_t facet = header_bytes + i * facet_bytes;
    if (auto moved = move_triple(file, role_nx, facet); !moved) return tl::unexpected(moved.error());
    for (std::size_t k = 1; k <= 3; ++k) {
      const std::byte* at = &bytes[facet + 12 * k];
      corners.push_back({load<float>(at), load<float>(at + 4), load<float>(at + 8)});
      const Place place = Place::byte(facet + 12 * k);
      if (auto finite = check_finite(file, place, corners.back()); !finite)
        return tl::unexpected(finite.error());
      if (auto moved = move_triple(file, role_x, facet + 12 * k); !moved)
        return tl::unexpected(moved.error());
    }
  }
  return weld(file, corners);
}

Result<Geometry> parse_ascii(const File& file) {
  Lines lines(file.text());
  std::string_view line;
  lines.next(line);  // "solid", and any name
  std::vector<Vec3d> corners;
  std::size_t in_loop = 0;
  while (lines.next_filled(line)) {
    const Place place = Place::line(lines.number());
    Words words(line);
    const std::string_view key = words.next();
    if (key == "vertex") {
      Vec3d corner;
      for (int i = 0; i < 3; ++i) {
        const std::string_view word = words.next();
        if (!parse_number(word, corner[i]))
          return bad(file, place, "a corner has ", in_quotes(word), ", not a finite number");
        if (file.mover) file.mover->word(i, word, corner[i]);
      }
      if (auto finite = check_finite(file, place, corner); !finite) return tl::unexpected(finite.error());
      if (file.mover)
        if (auto moved = file.mover->end_row(file, place); !moved) return tl::unexpected(moved.error());
      corners.push_back(corner);
      ++in_loop;
    } else if (key == "endloop" || key == "endfacet") {
      if (in_loop != 3 && (in_loop != 0 || key == "endloop"))
        return bad(file, place, "a facet of ", in_loop, " corners, not 3");
      in_loop = 0;
    } else if (key == "facet") {
      if (auto moved = move_normal(file, place, words); !moved) return tl::unexpected(moved.error());
    } else if (key != "outer" && key != "endsolid" && key != "solid") {
      return bad(file, place, in_quotes(key), " is not an STL keyword");
    }
  }
  if (in_loop != 0 || corners.size() % 3 != 0)
    return bad(file, Place::line(lines.number()), "the file ends within a facet");
  return weld(file, corners);
}

}  // namespace

Result<Geometry> parse_stl(const File& file) {
  // Some binary files start with "solid" too; their size gives them away.
  const auto& bytes = file.bytes;
  const bool exact =
      bytes.size() >= header_bytes &&
      bytes.size() - header_bytes == facet_bytes * std::uint64_t{load<std::uint32_t>(&bytes[80])};
  if (!exact && file.text().starts_with("solid")) return parse_ascii(file);
  return parse_binary(file);
}

}  // namespace bitr::io
