#include "picture/scene.hpp"

#include <algorithm>
#include <bitr/io.hpp>
#include <cmath>

#include "picture/camera.hpp"
#include "picture/captions.hpp"

namespace bitr::picture {
namespace {

using Eigen::Matrix3d, Eigen::Vector3d, Eigen::Vector3f;

Vector3d vector_of(const Vec3d& v) { return Vector3d(v.data()); }

Matrix3d matrix_of(const std::array<double, 9>& rows) {
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(rows.data());
}

// Mean spacing of the surface's points, from the median distance to the nearest neighbour: random points with
// a spacing s have a median of 0.47 s. A random part of a surface is as many times sparser as it is smaller.
float spacing_of(const PointCloud& cloud, const Box& box, double length) {
  constexpr std::size_t most = 1500;
  const PointCloud part = io::subsample(cloud, most, 0);
  if (part.size() < 2) return 0;
  Eigen::Matrix3Xf x(3, static_cast<Eigen::Index>(part.size()));
  for (Eigen::Index i = 0; i < x.cols(); ++i)
    x.col(i) = ((vector_of(part.positions[i]) - box.centre()) / length).cast<float>();
  std::vector<float> nearest(part.size());
  for (Eigen::Index i = 0; i < x.cols(); ++i) {
    Eigen::RowVectorXf squared = (x.colwise() - x.col(i)).colwise().squaredNorm();
    squared[i] = std::numeric_limits<float>::infinity();
    nearest[i] = squared.minCoeff();
  }
  const auto middle = nearest.begin() + static_cast<std::ptrdiff_t>(nearest.size() / 2);
  std::nth_element(nearest.begin(), middle, nearest.end());
  const double thinned = static_cast<double>(part.size()) / static_cast<double>(cloud.size());
  return static_cast<float>(std::sqrt(static_cast<double>(*middle) * thinned) / 0.47);
}

SeenCloud seen(const PointCloud& cloud, const std::vector<Vec3d>& key_points, const Box& box,
               const Matrix3d& turn, double length) {
  SeenCloud out;
  const auto see = [&](const Vec3d& point) -> Vector3f {
    return (turn * ((vector_of(point) - box.centre()) / length)).cast<float>();
  };
  out.points.reserve(cloud.size());
  for (const Vec3d& point : cloud.positions) out.points.push_back(see(point));
  for (const Vec3d& point : key_points) out.key_points.push_back(see(point));
  const Eigen::Matrix3f turn_f = turn.cast<float>();
  out.normals.reserve(cloud.normals.size());
  for (const Vec3f& normal : cloud.normals) out.normals.push_back(turn_f * Vector3f(normal.data()));
  return out;
}

Box box_of(const Part& part) {
  Box box;
  for (const Vector3f& point : part.cloud->points) box.add((point + part.offset).cast<double>());
  for (const Vector3f& point : part.cloud->key_points) box.add((point + part.offset).cast<double>());
  return box;
}

struct Offset {
  Vector3f seen = Vector3f::Zero();
  bool shortened = false;
};

// Where the source's centre is seen from the reference's, `centres` apart in the scene's units. Clouds
// farther apart than `room` times what they need to be clear of each other come that near.
Offset offset_between(const SeenCloud& source, const SeenCloud& reference, const Vector3d& centres,
                      double room) {
  const Vector3d clear = (box_of({.cloud = &source}).size() + box_of({.cloud = &reference}).size()) / 2;
  double keep = std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 2; ++axis)
    keep = std::min(keep, room * std::max(clear[axis], 1e-3) / std::abs(centres[axis]));
  const bool shortened = keep < 1;
  Vector3d drawn = shortened ? Vector3d(keep * centres) : centres;
  // Beside each other, nobody sees which is nearer, and each is as pale as in its own panel.
  const bool beside = std::abs(drawn[0]) > clear[0] || std::abs(drawn[1]) > clear[1];
  drawn[2] = beside ? 0 : std::clamp(drawn[2], -2.0, 2.0);
  return {drawn.cast<float>(), shortened};
}

std::string points_note(std::size_t points) {
  return with_commas(points) + (points == 1 ? " point" : " points");
}

std::string percent_note(const char* what, double share) {
  return what + std::to_string(std::lround(share * 100)) + " %";
}

std::string after_note(const Assembly& assembly, bool shortened, const PictureOptions& options) {
  const auto& overlap = assembly.diagnostics.overlap;
  std::string note = shortened                               ? "far apart, drawn closer"
                     : assembly.status == Status::degenerate ? "not determined"
                     : overlap                               ? percent_note("overlap ", *overlap)
                                                             : "assembled";
  if (options.confidence) note += ", " + percent_note("confidence ", *options.confidence);
  if (options.key_points && !assembly.source_key_points.empty()) note += ", rings are key points";
  return note;
}

}  // namespace

Scene::Scene(const PointCloud& source_cloud, const PointCloud& reference_cloud, const Assembly& assembly,
             const PictureOptions& options) {
  const Box source_box = box_of(source_cloud.positions), reference_box = box_of(reference_cloud.positions);
  length = std::max(source_box.diagonal(), reference_box.diagonal());
  if (!(length > 0)) length = 1;
  const Matrix3d view =
      options.view ? matrix_of(*options.view) : three_quarter_view(reference_cloud.positions);
  const Pose& pose = assembly.T_reference_source;
  const Matrix3d turned = view * matrix_of(pose.rotation);

  const std::vector<Vec3d> none;
  const auto& source_keys = options.key_points ? assembly.source_key_points : none;
  const auto& reference_keys = options.key_points ? assembly.reference_key_points : none;
  source = seen(source_cloud, source_keys, source_box, view, length);
  assembled = seen(source_cloud, source_keys, source_box, turned, length);
  reference = seen(reference_cloud, reference_keys, reference_box, view, length);
  source.spacing = assembled.spacing = spacing_of(source_cloud, source_box, length);
  reference.spacing = spacing_of(reference_cloud, reference_box, length);

  const Vector3d centre = source_box.centre();
  const auto seen_from_reference = [&](const Vector3d& point) -> Vector3d {
    return view * ((point - reference_box.centre()) / length);
  };
  const Offset before = offset_between(source, reference, seen_from_reference(centre), 1.15);
  const Offset after =
      offset_between(assembled, reference,
                     seen_from_reference(vector_of(pose.apply({centre[0], centre[1], centre[2]}))), 1.5);

  panels[0] = {
      .title = "source", .note = points_note(source_cloud.size()), .parts = {{Role::source, &source}}};
  panels[1] = {.title = "reference",
               .note = points_note(reference_cloud.size()),
               .parts = {{Role::reference, &reference}}};
  panels[2] = {.title = "before",
               .note = before.shortened ? "as given, drawn closer" : "as given",
               .parts = {{Role::source, &source, before.seen}, {Role::reference, &reference}}};
  panels[3] = {.title = "after",
               .note = after_note(assembly, after.shortened, options),
               .parts = {{Role::source, &assembled, after.seen}, {Role::reference, &reference}}};
  for (Panel& panel : panels) {
    for (const Part& part : panel.parts) {
      const Box box = box_of(part);
      panel.box.add(box.low);
      panel.box.add(box.high);
    }
  }
  arrange(options);
}

// Panels are as wide as what they show, or their captions; the scale is the largest for which all fit.
void Scene::arrange(const PictureOptions& options) {
  picture_width = options.width;
  letter = std::max(1, options.width / 960);
  caption_height = 30 * letter;
  const double pad = 12.0 * letter, room = options.height - caption_height - 2 * pad;
  std::array<double, 4> captions{}, widths{};
  for (int i = 0; i < 4; ++i)
    captions[i] = letter * std::max(text_width(panels[i].title), text_width(panels[i].note));
  const auto total = [&](double at) {
    double sum = 0;
    for (int i = 0; i < 4; ++i) {
      widths[i] = std::max(at * panels[i].box.size()[0], captions[i]) + 2 * pad;
      sum += widths[i];
    }
    return sum;
  };

  double tallest = 0.1;
  for (const Panel& panel : panels) tallest = std::max(tallest, panel.box.size()[1]);
  scale = room / tallest;
  if (total(scale) > options.width) {
    double low = 0;
    for (int step = 0; step < 50; ++step) {
      const double middle = (low + scale) / 2;
      (total(middle) > options.width ? scale : low) = middle;
    }
    scale = low;
  }

  const double spare = std::max(0.0, options.width - total(scale)) / 4;
  double left = 0;
  for (int i = 0; i < 4; ++i) {
    Panel& panel = panels[i];
    const double right = left + widths[i] + spare;
    panel.left = static_cast<int>(left);
    panel.width = std::min(options.width, static_cast<int>(right)) - panel.left;
    panel.middle = {(left + right) / 2, pad + room / 2};
    left = right;
  }
}

Vector3f Scene::project(const Panel& panel, const Vector3f& point) const {
  const Vector3f from_centre = static_cast<float>(scale) * (point - panel.box.centre().cast<float>());
  return {static_cast<float>(panel.middle[0]) + from_centre[0],
          static_cast<float>(panel.middle[1]) - from_centre[1], from_centre[2]};
}

}  // namespace bitr::picture
