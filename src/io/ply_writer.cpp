#include <algorithm>
#include <bit>
#include <cmath>
#include <string>

#include "io/complaint.hpp"
#include "io/formats.hpp"

namespace bitr::io {
namespace {

bool finite(const auto& triple) {
  return std::isfinite(triple[0]) && std::isfinite(triple[1]) && std::isfinite(triple[2]);
}

Result<void> check(const PointCloud& cloud) {
  const auto complain = [](const auto&... parts) {
    return fail(ErrorCode::invalid_argument, text(parts...));
  };
  for (const auto& [count, what] : {std::pair{cloud.normals.size(), std::string_view("normals")},
                                    std::pair{cloud.colors.size(), std::string_view("colours")}}) {
    if (count != 0 && count != cloud.size())
      return complain(count, " ", what, " for ", cloud.size(), " points");
  }
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (!finite(cloud.positions[i])) return complain("point ", i, " is not finite");
    if (!cloud.normals.empty() && !finite(cloud.normals[i])) return complain("normal ", i, " is not finite");
    if (!cloud.colors.empty() && !finite(cloud.colors[i])) return complain("colour ", i, " is not finite");
  }
  return {};
}

bool exact_as_float(const PointCloud& cloud) {
  return std::all_of(cloud.positions.begin(), cloud.positions.end(), [](const Vec3d& point) {
    return std::all_of(point.begin(), point.end(), [](double c) {
      return std::abs(c) <= std::numeric_limits<float>::max() &&
             static_cast<double>(static_cast<float>(c)) == c;
    });
  });
}

// Appends numbers in one encoding or the other; text takes the shortest digits that read back the same.
class Writer {
 public:
  Writer(std::vector<std::byte>& out, bool ascii) : out_(out), ascii_(ascii) {}

  void string(std::string_view part) {
    const auto* bytes = reinterpret_cast<const std::byte*>(part.data());
    out_.insert(out_.end(), bytes, bytes + part.size());
  }
  template <class T>
  void number(T value) {
    if (ascii_) {
      char digits[32];
      if (!first_) digits[0] = ' ';
      char* begin = digits + (first_ ? 0 : 1);
      string({digits,
              static_cast<std::size_t>(std::to_chars(begin, digits + sizeof digits, value).ptr - digits)});
      first_ = false;
    } else {
      static_assert(std::endian::native == std::endian::little);
      const auto* bytes = reinterpret_cast<const std::byte*>(&value);
      out_.insert(out_.end(), bytes, bytes + sizeof value);
    }
  }
  void end_row() {
    if (ascii_) string("\n");
    first_ = true;
  }

 private:
  std::vector<std::byte>& out_;
  bool ascii_, first_ = true;
};

}  // namespace

Result<std::vector<std::byte>> serialize_ply(const PointCloud& cloud, PlyEncoding encoding) {
  if (auto good = check(cloud); !good) return tl::unexpected(good.error());
  const bool ascii = encoding == PlyEncoding::ascii, floats = exact_as_float(cloud);
  std::string header = text("ply\nformat ", ascii ? "ascii" : "binary_little_endian", " 1.0\nelement vertex ",
                            cloud.size(), "\n");
  for (const std::string_view name : {"x", "y", "z"})
    header += text("property ", floats ? "float " : "double ", name, "\n");
  if (!cloud.normals.empty()) header += "property float nx\nproperty float ny\nproperty float nz\n";
  if (!cloud.colors.empty()) header += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  header += "end_header\n";

  std::vector<std::byte> out;
  const std::size_t row_bytes =
      (floats ? 12 : 24) + (cloud.normals.empty() ? 0 : 12) + (cloud.colors.empty() ? 0 : 3);
  out.reserve(header.size() + cloud.size() * row_bytes * (ascii ? 3 : 1));
  Writer writer(out, ascii);
  writer.string(header);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    // In text the digits are those of the double even where it is a float: a reader may keep more than a
    // float.
    for (const double c : cloud.positions[i])
      floats && !ascii ? writer.number(static_cast<float>(c)) : writer.number(c);
    if (!cloud.normals.empty()) {
      for (const float c : cloud.normals[i]) writer.number(c);
    }
    if (!cloud.colors.empty()) {
      for (const float c : cloud.colors[i])
        writer.number(static_cast<std::uint8_t>(std::lround(std::clamp(c, 0.0f, 1.0f) * 255)));
    }
    writer.end_row();
  }
  return out;
}

}  // namespace bitr::io
