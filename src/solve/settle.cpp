#include "solve/settle.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "refine/rigid_fit.hpp"

namespace bitr::solving {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

constexpr double slide = 0.01;        // of a residual along the surface, which holds what could slide
constexpr double least_cosine = 0.5;  // of matched normals
constexpr double tolerance = 2e-3;    // of a step, in resolutions
constexpr double most_turn = 0.5;     // radians in one step

struct Sums {
  Matrix6 A = Matrix6::Zero();
  Vector6 b = Vector6::Zero();
};

class Step {
 public:
  Step(const Level& source, const Level& reference, const Pose& T, double reach, double unit)
      : source_(source),
        reference_(reference),
        T_(T),
        inverse_(T.inverse()),
        R_(refine::rotation_of(T)),
        t_(vector(T.translation)),
        reach_(reach),
        unit_(unit) {}

  void look(std::size_t every) {
    for (std::size_t i = 0; i < source_.size(); i += every) {
      const Vec3d moved = T_.apply(source_.points[i]);
      const NearestWithin nearest = nearest_within(reference_, moved, reach_);
      if (!nearest.found()) continue;
      add(vector(moved), R_ * vector(source_.normals[i]), vector(reference_.points[nearest.index()]),
          vector(reference_.normals[nearest.index()]), nearest.squared());
    }
    for (std::size_t i = 0; i < reference_.size(); i += every) {
      const NearestWithin nearest = nearest_within(source_, inverse_.apply(reference_.points[i]), reach_);
      if (!nearest.found()) continue;
      add(R_ * vector(source_.points[nearest.index()]) + t_, R_ * vector(source_.normals[nearest.index()]),
          vector(reference_.points[i]), vector(reference_.normals[i]), nearest.squared());
    }
  }

  Pose solved() {
    if (count_ < 6) return {};
    Matrix6 A = sums_.A;
    A.diagonal().array() += 1e-9 * A.trace();
    const Vector6 x = A.selfadjointView<Eigen::Lower>().ldlt().solve(sums_.b);
    if (!x.allFinite()) return {};
    const Eigen::Vector3d turn = x.head<3>();
    const double angle = turn.norm();
    Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
    if (angle > 0) R = Eigen::AngleAxisd(std::min(angle, most_turn), turn / angle).toRotationMatrix();
    return refine::pose_of(R, unit_ * x.tail<3>());
  }

 private:
  void add(const Eigen::Vector3d& p, const Eigen::Vector3d& np, const Eigen::Vector3d& q, Eigen::Vector3d nq,
           double squared) {
    double cosine = np.dot(nq);
    if (source_.solid && cosine > 0) return;
    if (cosine < 0) nq = -nq, cosine = -cosine;
    if (cosine < least_cosine) return;
    const double near = 1 - squared / (reach_ * reach_), weight = near * near * cosine;
    const Eigen::Vector3d n = (np + nq).normalized(), at = p / unit_, gap = (q - p) / unit_;
    row(at.cross(n), n, weight, n.dot(gap));
    for (int a = 0; a < 3; ++a) {
      const Eigen::Vector3d axis = Eigen::Vector3d::Unit(a);
      row(at.cross(axis), axis, slide * weight, gap[a]);
    }
    ++count_;
  }
  void row(const Eigen::Vector3d& turn, const Eigen::Vector3d& shift, double weight, double residual) {
    Vector6 r;
    r << turn, shift;
    sums_.A.selfadjointView<Eigen::Lower>().rankUpdate(r, weight);
    sums_.b += weight * residual * r;
  }

  const Level &source_, &reference_;
  const Pose T_, inverse_;
  const Eigen::Matrix3d R_;
  const Eigen::Vector3d t_;
  const double reach_, unit_;
  Sums sums_;
  std::size_t count_ = 0;
};

}  // namespace

Motion::Motion(const Level& level) : mean_(Eigen::Vector3d::Zero()), scatter_(Eigen::Matrix3d::Zero()) {
  const auto n = static_cast<double>(level.size());
  for (const Vec3d& p : level.points) mean_ += vector(p) / n;
  for (const Vec3d& p : level.points) scatter_ += (vector(p) - mean_) * (vector(p) - mean_).transpose() / n;
}

double Motion::between(const Pose& a, const Pose& b) const {
  const Eigen::Matrix3d turn = refine::rotation_of(a) - refine::rotation_of(b);
  const Eigen::Vector3d shift = turn * mean_ + vector(a.translation) - vector(b.translation);
  return std::sqrt(std::max(0.0, shift.squaredNorm() + (turn * scatter_ * turn.transpose()).trace()));
}

Pose icp(const Level& source, const Level& reference, const Pose& start, const IcpOptions& options) {
  const double v = source.resolution;
  const std::size_t every = std::max<std::size_t>(1, (source.size() + reference.size()) / options.points);
  const Motion motion(source);
  Pose T = start;
  double reach = options.catches * v;
  for (int i = 0; i < options.iterations; ++i) {
    Step step(source, reference, T, reach, v);
    step.look(every);
    const Pose next = step.solved() * T;
    const double moved = motion.between(next, T);
    T = next;
    const bool last = reach <= options.ends * v;
    if (last && moved < tolerance * v) break;
    reach = std::max(options.ends * v, reach * 0.8);
  }
  return T;
}

}  // namespace bitr::solving
