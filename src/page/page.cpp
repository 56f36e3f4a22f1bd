#include <bitr/io.hpp>
#include <bitr/view.hpp>
#include <cmath>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>
#include <numbers>
#include <string_view>

#include "core/base64.hpp"
#include "core/guarded.hpp"
#include "core/spacing.hpp"
#include "page/normals.hpp"
#include "page/thin.hpp"
#include "picture/box.hpp"
#include "picture/camera.hpp"
#include "picture/checks.hpp"

extern "C" {
extern const char bitr_page_begin[], bitr_page_end[];  // see CMakeLists.txt
}

namespace bitr {
namespace {

using Eigen::Vector3d;
using Json = nlohmann::ordered_json;

/// Where the page takes its data.
constexpr std::string_view mark = "/* data */";

std::string_view page() {
  return {bitr_page_begin, static_cast<std::size_t>(bitr_page_end - bitr_page_begin)};
}

Vector3d vector_of(const Vec3d& v) { return Vector3d(v.data()); }
Json json_of(const Vector3d& v) { return {v[0], v[1], v[2]}; }

void check_cloud(const PointCloud& cloud, const std::string& name) {
  picture::check(cloud, name);
  if (!cloud.colors.empty() && cloud.colors.size() != cloud.size())
    refuse(name + ": " + std::to_string(cloud.colors.size()) + " colours for " +
           std::to_string(cloud.size()) + " points");
}

/// Bytes of whole numbers or floats, the least significant first whatever the machine.
class Bytes {
 public:
  void add(float value) {
    std::uint32_t bits;
    std::memcpy(&bits, &value, sizeof bits);
    for (int byte = 0; byte < 4; ++byte) add_byte(bits >> 8 * byte);
  }
  void add_byte(std::uint32_t value) { bytes_.push_back(static_cast<std::byte>(value & 255)); }
  std::string text() const { return base64(bytes_); }

 private:
  std::vector<std::byte> bytes_;
};

/// Relative to the centre of the cloud's box, in units of `length`.
std::string floats_of(const std::vector<Vec3d>& points, const Vector3d& centre, double length) {
  Bytes bytes;
  for (const Vec3d& point : points)
    for (const double x : ((vector_of(point) - centre) / length).eval()) bytes.add(static_cast<float>(x));
  return bytes.text();
}

/// Each number from −1 … 1 or 0 … 1 as a whole number of that many steps.
std::string steps_of(const std::vector<Vec3f>& rows, float least, float steps) {
  Bytes bytes;
  for (const Vec3f& row : rows)
    for (const float x : row)
      bytes.add_byte(static_cast<std::uint32_t>(std::lround(steps * std::clamp(x, least, 1.0F))));
  return bytes.text();
}

template <class Row>
std::vector<Row> chosen(const std::vector<Row>& rows, const std::vector<std::size_t>& kept) {
  std::vector<Row> some;
  if (rows.empty()) return some;
  for (const std::size_t i : kept) some.push_back(rows[i]);
  return some;
}

struct Placed {
  const PointCloud& cloud;
  const std::vector<Vec3d>& key_points;
  std::string name;
  picture::Box box = picture::box_of(cloud.positions);
};

Json json_of(const Placed& placed, double length, std::size_t most_points) {
  const PointCloud& cloud = placed.cloud;
  const std::vector<std::size_t> kept = view::thinned(cloud.positions, most_points);
  const std::vector<Vec3d> points = chosen(cloud.positions, kept);
  const Vector3d centre = placed.box.centre();
  const PointRows rows{points};
  const PointTree tree(3, rows);
  // Random points on a surface have a median distance of 0.47 of their spacing.
  const double spacing = median_spacing(tree, points) / 0.47 / length;
  Json json = {{"name", placed.name},
               {"count", cloud.size()},
               {"shown", points.size()},
               {"centre", json_of(centre)},
               {"spacing", spacing > 0 ? spacing : 0.01},
               {"positions", floats_of(points, centre, length)},
               {"key_points", floats_of(placed.key_points, centre, length)}};
  const std::vector<Vec3f> normals = chosen(cloud.normals, kept);
  json["normals"] = steps_of(normals.empty() ? view::fitted_normals(tree, points) : normals, -1, 127);
  if (!cloud.colors.empty()) json["colors"] = steps_of(chosen(cloud.colors, kept), 0, 255);
  return json;
}

Json data_of(const PointCloud& source_cloud, const PointCloud& reference_cloud, const Assembly& assembly,
             const ViewOptions& options) {
  const Placed source{source_cloud, assembly.source_key_points, options.source_name};
  const Placed reference{reference_cloud, assembly.reference_key_points, options.reference_name};
  double length = std::max(source.box.diagonal(), reference.box.diagonal());
  if (!(length > 0)) length = 1;
  const auto from_reference = [&](const Vector3d& point) -> Vector3d {
    return (point - reference.box.centre()) / length;
  };
  const Vector3d centre = source.box.centre();
  std::vector<Pose> poses = {assembly.T_reference_source};
  poses.insert(poses.end(), options.alternatives.begin(), options.alternatives.end());
  Json ways = Json::array();
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const Vector3d after = from_reference(vector_of(poses[i].apply({centre[0], centre[1], centre[2]})));
    ways.push_back({{"name", options.names.empty() ? "assembled" : options.names[i]},
                    {"rotation", poses[i].rotation},
                    {"after", json_of(after)}});
  }
  Vector3d before = from_reference(centre);
  // No farther than clear of each other: both have to be on the screen.
  const double most = 1.15 * (source.box.diagonal() + reference.box.diagonal()) / 2 / length;
  const bool closer = before.stableNorm() > most;
  if (closer) before *= most / before.stableNorm();
  const Eigen::Matrix3d view = picture::three_quarter_view(reference_cloud.positions);
  Json report = Json::parse(options.report, nullptr, false);
  if (!report.is_object()) refuse("a view's report is no JSON object");
  return {{"length", length},
          {"source", json_of(source, length, options.most_points)},
          {"reference", json_of(reference, length, options.most_points)},
          {"before", json_of(before)},
          {"poses", std::move(ways)},
          {"brought_closer", closer},
          {"view",
           {view(0, 0), view(0, 1), view(0, 2), view(1, 0), view(1, 1), view(1, 2), view(2, 0), view(2, 1),
            view(2, 2)}},
          {"report", std::move(report)}};
}

/// JSON that no browser takes for the end of its script; names of files need not be UTF-8, JSON must be.
std::string script_text(const Json& json) {
  std::string text;
  for (const char c : json.dump(-1, ' ', false, Json::error_handler_t::replace)) {
    if (c == '<')
      text += "\\u003c";
    else
      text += c;
  }
  return text;
}

}  // namespace

bool has_view() { return page().find(mark) != std::string_view::npos; }

Result<std::string> render_view(const PointCloud& source, const PointCloud& reference,
                                const Assembly& assembly, const ViewOptions& options) {
  return guarded([&]() -> Result<std::string> {
    if (!has_view())
      return fail(
          ErrorCode::unsupported,
          "this build has no view: it was configured without viewer/node_modules (npm ci in viewer/)");
    check_cloud(source, "source");
    check_cloud(reference, "reference");
    picture::check(assembly);
    if (options.most_points == 0) refuse("a view of most_points 0");
    const std::size_t named = options.names.size(), poses = options.alternatives.size() + 1;
    if (named != poses && (named > 0 || poses > 1))
      refuse("a view of " + std::to_string(poses) + " poses with " + std::to_string(named) + " names");
    for (const Pose& pose : options.alternatives) picture::check(pose);
    const std::string data = script_text(data_of(source, reference, assembly, options));
    const std::size_t at = page().find(mark);
    std::string html(page().substr(0, at));
    html.append(data).append(page().substr(at + mark.size()));
    return html;
  });
}

Result<void> write_view(const std::filesystem::path& path, const PointCloud& source,
                        const PointCloud& reference, const Assembly& assembly, const ViewOptions& options) {
  const auto html = render_view(source, reference, assembly, options);
  if (!html) return tl::unexpected(html.error());
  return io::write_file(path, std::as_bytes(std::span(*html)));
}

}  // namespace bitr
