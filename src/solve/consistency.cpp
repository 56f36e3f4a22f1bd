#include "solve/consistency.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>

#include <Eigen/Geometry>

#include "refine/rigid_fit.hpp"

namespace bitr::solving {
namespace {

using Vec = Eigen::Vector3f;

constexpr float length_tolerance = 1;  // resolutions
constexpr float least_apart = 2;       // resolutions: closer pairings say nothing of a rotation
constexpr float angle_tolerance = 0.35f;
constexpr std::size_t set_size = 30, fewest = 4;
constexpr double inlier_distance = 2;  // resolutions
constexpr int fits = 3;

/// A symmetric relation between n things, as rows of bits.
class Relation {
 public:
  explicit Relation(std::size_t n) : words_((n + 63) / 64), bits_(n * words_, 0) {}
  std::size_t words() const { return words_; }
  std::uint64_t* row(std::size_t i) { return &bits_[i * words_]; }
  const std::uint64_t* row(std::size_t i) const { return &bits_[i * words_]; }
  unsigned common(std::size_t i, std::size_t j) const {
    const std::uint64_t *a = row(i), *b = row(j);
    std::uint64_t sum = 0;
    for (std::size_t w = 0; w < words_; ++w) sum += static_cast<std::uint64_t>(std::popcount(a[w] & b[w]));
    return static_cast<unsigned>(sum);
  }
  template <class Visit>
  void each(std::size_t i, const Visit& visit) const {
    for (std::size_t w = 0; w < words_; ++w)
      for (std::uint64_t bits = row(i)[w]; bits; bits &= bits - 1)
        visit(64 * w + static_cast<std::size_t>(std::countr_zero(bits)));
  }

 private:
  std::size_t words_;
  std::vector<std::uint64_t> bits_;
};

/// Coordinates of matched points and normals, one array each.
struct Side {
  std::vector<float> x, y, z, nx, ny, nz;
  void add(const Vec3d& p, const Vec3d& n, double resolution) {
    const auto f = [](double v) { return static_cast<float>(v); };
    x.push_back(f(p[0] / resolution)), y.push_back(f(p[1] / resolution)), z.push_back(f(p[2] / resolution));
    nx.push_back(f(n[0])), ny.push_back(f(n[1])), nz.push_back(f(n[2]));
  }
};

struct Relative {
  float distance, normals, here, there;
};
inline Relative relative(const Side& s, std::size_t i, std::size_t j) {
  const float dx = s.x[j] - s.x[i], dy = s.y[j] - s.y[i], dz = s.z[j] - s.z[i];
  const float distance = std::sqrt(dx * dx + dy * dy + dz * dz), inverse = 1 / std::max(distance, 1e-6f);
  return {distance, std::abs(s.nx[i] * s.nx[j] + s.ny[i] * s.ny[j] + s.nz[i] * s.nz[j]),
          std::abs(s.nx[i] * dx + s.ny[i] * dy + s.nz[i] * dz) * inverse,
          std::abs(s.nx[j] * dx + s.ny[j] * dy + s.nz[j] * dz) * inverse};
}

Relation consistent(const Side& a, const Side& b, ThreadPool& pool) {
  const std::size_t n = a.x.size();
  Relation relation(n);
  pool.parallel_for(n, 32, [&](std::size_t begin, std::size_t end) {
    std::vector<unsigned char> row(64 * relation.words(), 0);
    for (std::size_t i = begin; i < end; ++i) {
      for (std::size_t j = 0; j < n; ++j) {
        const Relative s = relative(a, i, j), r = relative(b, i, j);
        row[j] = (std::abs(s.distance - r.distance) < length_tolerance) &
                 (std::min(s.distance, r.distance) > least_apart) &
                 (std::abs(s.normals - r.normals) < angle_tolerance) &
                 (std::abs(s.here - r.here) < angle_tolerance) &
                 (std::abs(s.there - r.there) < angle_tolerance);
      }
      for (std::size_t w = 0; w < relation.words(); ++w) {
        std::uint64_t bits = 0;
        for (std::size_t k = 0; k < 64; ++k) bits |= static_cast<std::uint64_t>(row[64 * w + k]) << k;
        relation.row(i)[w] = bits;
      }
    }
  });
  return relation;
}

struct Member {
  std::uint32_t index;
  unsigned weight;
};

// The pairings most consistent with a seed, the seed first.
std::vector<Member> members_around(const Relation& relation, std::size_t seed) {
  std::vector<Member> members;
  relation.each(seed, [&](std::size_t j) {
    if (const unsigned common = relation.common(seed, j); common > 0)
      members.push_back({static_cast<std::uint32_t>(j), common});
  });
  const std::size_t kept = std::min(set_size, members.size());
  std::partial_sort(members.begin(), members.begin() + static_cast<std::ptrdiff_t>(kept), members.end(),
                    [](const Member& a, const Member& b) {
                      return a.weight > b.weight || (a.weight == b.weight && a.index < b.index);
                    });
  members.resize(kept);
  members.insert(members.begin(), {static_cast<std::uint32_t>(seed), 0});
  return members;
}

class Matched {
 public:
  Matched(const Level& source, const Level& reference, std::span<const Pairing> pairings)
      : tolerance_(inlier_distance * source.resolution) {
    for (const Pairing& p : pairings) {
      from_.push_back(vector(source.points[p.source]));
      to_.push_back(vector(reference.points[p.reference]));
    }
  }

  Pose fitted(const std::vector<std::uint32_t>& rows, const Eigen::VectorXd& weights) const {
    return refine::fit(
        rows.size(), [&](std::size_t i) { return weights[static_cast<Eigen::Index>(i)]; },
        [&](std::size_t i) -> const Eigen::Vector3d& { return from_[rows[i]]; },
        [&](std::size_t i) -> const Eigen::Vector3d& { return to_[rows[i]]; });
  }
  std::vector<std::uint32_t> brought_together(const Pose& T) const {
    const Eigen::Matrix3d R = refine::rotation_of(T);
    const Eigen::Vector3d t = vector(T.translation);
    std::vector<std::uint32_t> rows;
    for (std::uint32_t i = 0; i < from_.size(); ++i)
      if ((R * from_[i] + t - to_[i]).squaredNorm() < tolerance_ * tolerance_) rows.push_back(i);
    return rows;
  }

 private:
  double tolerance_;
  std::vector<Eigen::Vector3d> from_, to_;
};

Eigen::VectorXd leading_vector(const Relation& relation, const std::vector<std::uint32_t>& rows) {
  const auto n = static_cast<Eigen::Index>(rows.size());
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(n, n);
  for (Eigen::Index i = 0; i < n; ++i)
    for (Eigen::Index j = i + 1; j < n; ++j)
      if (relation.row(rows[i])[rows[j] / 64] >> (rows[j] % 64) & 1)
        A(i, j) = A(j, i) = relation.common(rows[i], rows[j]);
  Eigen::VectorXd v = Eigen::VectorXd::Ones(n);
  for (int k = 0; k < 10; ++k) {
    v = A * v;
    v /= v.norm() + 1e-12;
  }
  return v;
}

}  // namespace

std::vector<Hypothesis> consensus(const Level& source, const Level& reference,
                                  std::span<const Pairing> pairings, std::size_t most, ThreadPool& pool) {
  const std::size_t n = pairings.size();
  if (n < fewest) return {};
  Side a, b;
  for (const Pairing& p : pairings) {
    a.add(source.points[p.source], source.normals[p.source], source.resolution);
    b.add(reference.points[p.reference], reference.normals[p.reference], source.resolution);
  }
  const Relation relation = consistent(a, b, pool);
  std::vector<std::uint64_t> degree(n, 0);
  pool.parallel_for(n, 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      relation.each(i, [&](std::size_t j) { degree[i] += relation.common(i, j); });
  });
  std::vector<std::uint32_t> order(n);
  std::iota(order.begin(), order.end(), 0u);
  std::stable_sort(order.begin(), order.end(),
                   [&](std::uint32_t i, std::uint32_t j) { return degree[i] > degree[j]; });

  const Matched matched(source, reference, pairings);
  std::vector<char> used(n, 0);
  std::vector<Hypothesis> found;
  for (const std::uint32_t seed : order) {
    if (found.size() >= 3 * most || degree[seed] == 0) break;
    if (used[seed]) continue;
    used[seed] = 1;
    std::vector<std::uint32_t> rows;
    for (const Member& member : members_around(relation, seed)) rows.push_back(member.index);
    if (rows.size() < fewest + 1) continue;
    Pose T = matched.fitted(rows, leading_vector(relation, rows));
    for (int k = 0; k < fits; ++k) {
      rows = matched.brought_together(T);
      if (rows.size() < fewest) break;
      T = matched.fitted(rows, Eigen::VectorXd::Ones(static_cast<Eigen::Index>(rows.size())));
    }
    rows = matched.brought_together(T);
    for (const std::uint32_t i : rows) used[i] = 1;
    found.push_back({T, static_cast<double>(rows.size())});
  }
  std::stable_sort(found.begin(), found.end(),
                   [](const Hypothesis& x, const Hypothesis& y) { return x.support > y.support; });
  if (found.size() > most) found.resize(most);
  return found;
}

}  // namespace bitr::solving
