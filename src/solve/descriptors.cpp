#include "solve/descriptors.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

namespace bitr::solving {
namespace {

using Vec = Eigen::Vector3f;

/// The three angles of a pair of points with normals, each as a bin.
struct Bins {
  int alpha, phi, theta;
};

int bin(float value) {  // of -1 … 1
  return std::clamp(static_cast<int>((value + 1) * (descriptor_bins / 2.0f)), 0, descriptor_bins - 1);
}

// The angle of (x, y) in half turns, -1 … 1, to 1/500: what a bin needs.
float half_turns(float y, float x) {
  const float ax = std::abs(x), ay = std::abs(y), larger = std::max(ax, ay);
  if (!(larger > 0)) return 0;
  const float ratio = std::min(ax, ay) / larger;
  float turn = ratio * (0.25f + 0.0869f * (1 - ratio));
  if (ay > ax) turn = 0.5f - turn;
  if (x < 0) turn = 1 - turn;
  return y < 0 ? -turn : turn;
}

Bins pair_bins(const Vec& p, Vec np, const Vec& q, Vec nq) {
  Vec d = q - p;
  const float length = d.norm();
  if (!(length > 0)) return {descriptor_bins / 2, descriptor_bins / 2, descriptor_bins / 2};
  d /= length;
  float along_p = np.dot(d), along_q = nq.dot(d);
  // The frame stands at the point whose normal is nearer to the line between them, so that both see the
  // same.
  if (std::abs(along_p) < std::abs(along_q)) {
    std::swap(np, nq);
    d = -d;
    along_p = -along_q;
  }
  Vec v = d.cross(np);
  const float across = v.norm();
  if (!(across > 1e-6f)) return {descriptor_bins / 2, bin(along_p), descriptor_bins / 2};
  v /= across;
  const Vec w = np.cross(v);
  return {bin(v.dot(nq)), bin(along_p), bin(half_turns(w.dot(nq), np.dot(nq)))};
}

}  // namespace

std::vector<Descriptors> describe(const Level& level, const Neighbours& near,
                                  const std::vector<Vec3d>& normals, std::span<const double> radii,
                                  ThreadPool& pool) {
  const std::size_t n = level.size(), levels = radii.size();
  std::vector<Vec> points(n), sides(n);
  for (std::size_t i = 0; i < n; ++i) {
    points[i] = vector(level.points[i]).cast<float>();
    sides[i] = vector(normals[i]).cast<float>();
  }
  // How many of the neighbours are within each radius.
  std::vector<std::uint32_t> reach(n * levels);
  std::vector<Descriptors> simple(levels, Descriptors::Zero(descriptor_size, static_cast<Eigen::Index>(n)));
  pool.parallel_for(n, 64, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      Eigen::Matrix<float, descriptor_size, 1> sum = Eigen::Matrix<float, descriptor_size, 1>::Zero();
      std::uint32_t k = 0;
      for (std::size_t l = 0; l < levels; ++l) {
        for (; k < near.count[i] && near.distance[i * near.most + k] <= radii[l]; ++k) {
          const std::uint32_t j = near.index[i * near.most + k];
          const Bins bins = pair_bins(points[i], sides[i], points[j], sides[j]);
          sum[bins.alpha] += 1;
          sum[descriptor_bins + bins.phi] += 1;
          sum[2 * descriptor_bins + bins.theta] += 1;
        }
        reach[i * levels + l] = k;
        if (k > 0) simple[l].col(i) = sum / static_cast<float>(k);
      }
    }
  });
  std::vector<Descriptors> result(levels, Descriptors(descriptor_size, static_cast<Eigen::Index>(n)));
  pool.parallel_for(n, 64, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      for (std::size_t l = 0; l < levels; ++l) {
        Eigen::Matrix<float, descriptor_size, 1> sum = Eigen::Matrix<float, descriptor_size, 1>::Zero();
        for (std::uint32_t k = 0; k < reach[i * levels + l]; ++k) {
          const float distance = near.distance[i * near.most + k];
          sum += simple[l].col(near.index[i * near.most + k]) / std::max(distance * distance, 1e-30f);
        }
        for (int part = 0; part < 3; ++part) {
          const float total = sum.segment<descriptor_bins>(part * descriptor_bins).sum();
          auto bins = result[l].col(i).segment<descriptor_bins>(part * descriptor_bins);
          bins = simple[l].col(i).segment<descriptor_bins>(part * descriptor_bins);
          if (total > 0) bins += sum.segment<descriptor_bins>(part * descriptor_bins) / total;
          bins = (bins / 2).cwiseSqrt();
        }
      }
  });
  return result;
}

Descriptors flipped(const Descriptors& descriptors) {
  Descriptors result = descriptors;
  for (int part = 1; part < 3; ++part)
    result.middleRows(part * descriptor_bins, descriptor_bins) =
        descriptors.middleRows(part * descriptor_bins, descriptor_bins).colwise().reverse();
  return result;
}

}  // namespace bitr::solving
