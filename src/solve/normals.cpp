#include "solve/normals.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <queue>
#include <tuple>

namespace bitr::solving {
namespace {

constexpr std::size_t normal_neighbours = 30;
constexpr double normal_reach = 3;  // resolutions
// On a straight rim the neighbours' mean direction is 2/π long, inside 0.
constexpr double least_one_sided = 0.45;
constexpr std::size_t spread_neighbours = 12;

Eigen::Vector3d flattest_direction(const Eigen::Matrix3d& scatter) {
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
  // The closed form loses digits that nobody has measured.
  solver.computeDirect(scatter);
  return solver.eigenvectors().col(0);
}

struct Around {
  Eigen::Vector3d normal;
  bool rim;
};

Around around(const Level& level, const Neighbours& near, std::size_t i) {
  const Eigen::Vector3d here = vector(level.points[i]);
  const std::uint32_t* index = &near.index[i * near.most];
  const float* distance = &near.distance[i * near.most];
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  double distances = 0;
  std::size_t count = 0;
  for (; count < std::min<std::size_t>(near.count[i], normal_neighbours); ++count) {
    if (distance[count] > normal_reach * level.resolution) break;
    mean += vector(level.points[index[count]]) - here;
    distances += distance[count];
  }
  const Eigen::Vector3d sum = mean;
  mean /= static_cast<double>(count + 1);
  Eigen::Matrix3d scatter = mean * mean.transpose();
  for (std::size_t k = 0; k < count; ++k) {
    const Eigen::Vector3d from = vector(level.points[index[k]]) - here - mean;
    scatter += from * from.transpose();
  }
  Eigen::Vector3d normal = vector(level.normals[i]);
  if (!(normal.norm() > 0.5)) normal = count >= 2 ? flattest_direction(scatter) : Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d along = sum - sum.dot(normal) * normal;
  return {normal, count < 3 || along.norm() > least_one_sided * distances};
}

double dot(const Vec3d& a, const Vec3d& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

void flip(Vec3d& v) {
  for (double& c : v) c = -c;
}

// Prim's algorithm, one tree per connected part.
void spread(const Level& level, const Neighbours& near, std::vector<Vec3d>& normals) {
  using Step = std::tuple<double, std::uint32_t, std::uint32_t>;  // cost, to, from
  std::vector<char> reached(normals.size(), 0);
  std::priority_queue<Step, std::vector<Step>, std::greater<>> steps;
  std::vector<std::uint32_t> part;
  for (std::uint32_t start = 0; start < normals.size(); ++start) {
    if (reached[start]) continue;
    part.clear();
    steps.emplace(0, start, start);
    while (!steps.empty()) {
      const auto [cost, to, from] = steps.top();
      steps.pop();
      if (reached[to]) continue;
      reached[to] = 1;
      part.push_back(to);
      if (dot(normals[from], normals[to]) < 0) flip(normals[to]);
      for (std::size_t k = 0; k < std::min<std::size_t>(near.count[to], spread_neighbours); ++k) {
        const std::uint32_t next = near.index[to * near.most + k];
        if (!reached[next]) steps.emplace(1 - std::abs(dot(normals[to], normals[next])), next, to);
      }
    }
    double outward = 0;
    for (const std::uint32_t i : part) outward += dot(normals[i], level.points[i]);
    if (outward < 0)
      for (const std::uint32_t i : part) flip(normals[i]);
  }
}

/// Where an estimated normal points to, more or less: the viewpoint, or where the given ones around do.
Vec3d side_of(const Level& level, const Neighbours& near, const std::optional<Vec3d>& viewpoint,
              const std::vector<Vec3d>& given, std::size_t i) {
  if (viewpoint) return row(vector(*viewpoint) - vector(level.points[i]));
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (std::size_t k = 0; k < std::min<std::size_t>(near.count[i], normal_neighbours); ++k)
    sum += vector(given[near.index[i * near.most + k]]);
  return row(sum);
}

}  // namespace

Neighbours neighbours(const Level& level, double within, std::size_t most, ThreadPool& pool) {
  const std::size_t n = level.size();
  most = std::min(most, n > 1 ? n - 1 : 1);
  Neighbours near{most, std::vector<std::uint32_t>(n * most), std::vector<float>(n * most),
                  std::vector<std::uint32_t>(n, 0)};
  pool.parallel_for(n, 64, [&](std::size_t begin, std::size_t end) {
    std::vector<std::uint32_t> index(most + 1);
    std::vector<double> squared(most + 1);
    for (std::size_t i = begin; i < end; ++i) {
      const std::size_t found =
          level.tree->knnSearch(level.points[i].data(), most + 1, index.data(), squared.data());
      std::uint32_t& count = near.count[i];
      for (std::size_t k = 0; k < found && count < most; ++k) {
        if (index[k] == i || squared[k] > within * within) continue;
        near.index[i * most + count] = index[k];
        near.distance[i * most + count++] = static_cast<float>(std::sqrt(squared[k]));
      }
    }
  });
  return near;
}

void estimate_normals(Level& level, const Neighbours& near, const std::optional<Vec3d>& viewpoint,
                      ThreadPool& pool) {
  level.normals.resize(level.size(), Vec3d{});
  level.rim.assign(level.size(), 0);
  const std::vector<Vec3d> given = level.normals;
  pool.parallel_for(level.size(), 128, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Around found = around(level, near, i);
      level.normals[i] = row(found.normal);
      level.rim[i] = found.rim;
      if (dot(given[i], given[i]) > 0.25) continue;
      if (dot(level.normals[i], side_of(level, near, viewpoint, given, i)) < 0) flip(level.normals[i]);
    }
  });
  level.given_normals = level.given_normals || viewpoint;
}

std::vector<Vec3d> signed_normals(const Level& level, const Neighbours& near, Signs signs) {
  std::vector<Vec3d> normals = level.normals;
  if (signs == Signs::given) return normals;
  for (std::size_t i = 0; i < normals.size(); ++i)
    if (dot(normals[i], level.points[i]) < 0) flip(normals[i]);
  if (signs == Signs::spread) spread(level, near, normals);
  return normals;
}

}  // namespace bitr::solving
