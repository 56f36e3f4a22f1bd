#include "refine/surface_icp.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "refine/matching.hpp"
#include "refine/rigid_fit.hpp"

namespace bitr::refine {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

// All measured on generated pairs, see docs/refinement.md.
constexpr double share_exponent = 1.3;   // λ of the fractional RMSD
constexpr double least_share = 0.1;      // at least this share of the matches is kept
constexpr double biweight_spacings = 4;  // where Tukey's biweight ends …
constexpr double biweight_rmse = 2.5;  // … or so many times the kept matches' deviation, if that is longer
constexpr double slide = 0.02;         // ε: what holds surfaces along which points can slide
constexpr double most_normal_length = 8, first_normal_length = 4;  // λ, in the same scale
constexpr double least_cosine = 0.3;                               // between matched normals
constexpr double tolerance = 1e-3;  // a step that moves points by less is the last; in spacings
constexpr double most_turn = 0.5;   // radians in one step, where the linear solution means nothing

double median(std::vector<double>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

class Aligner : public Stepper {
 public:
  Aligner(const Surface& source, const Surface& reference, const Pose& start,
          const SurfaceIcpOptions& options, SurfaceIcpResult& result)
      : source_(source), reference_(reference), options_(options), result_(result) {
    spacing_ = std::max(source.spacing, reference.spacing);
    for (const Vec3d& point : source.points) radius_ = std::max(radius_, vector(point).norm());
    normals_ = source.has_normals() && reference.has_normals();
    scale_ = spacing_;
    rule_.oriented = options.oriented;
    rule_.normal_length = normals_ ? first_normal_length * scale_ : 0;
    result_ = {};
    result_.T = start;
  }

  Wanted wanted() override {
    if (result_.iterations < options_.most_iterations && !result_.converged)
      return {match(source_, reference_, result_.T, rule_, matches_)};
    result_.workspace_bytes = matches_.capacity() * sizeof(Match) + 3 * matches_.size() * sizeof(double);
    return {};
  }

  void step() override {
    ++result_.iterations;
    // A slow approach must not use up what the fine stage needs.
    if (!fine_ && result_.iterations > options_.most_iterations * 2 / 3) fine_ = true;
    fine_ ? weigh() : trim();
    if (normals_) balance_normals();
    const Pose step = normals_ ? plane_step() : point_step();
    result_.T = step * result_.T;
    if (size_of(step) < tolerance * spacing_) {
      result_.converged = fine_;
      fine_ = true;
    }
  }

 private:
  void trim() {
    std::sort(matches_.begin(), matches_.end(), [](const Match& a, const Match& b) {
      return a.squared < b.squared || (a.squared == b.squared && a.order < b.order);
    });
    const auto all = static_cast<double>(matches_.size());
    std::size_t kept = matches_.size();
    if (options_.keep) {
      const auto n = static_cast<double>(source_.points.size()),
                 m = static_cast<double>(reference_.points.size());
      kept = static_cast<std::size_t>(*options_.keep * 2 * std::min(n, m) / (n + m) * all);
    } else {
      // What exact copies would make 0, and every share as good as any other.
      const double floor = 1e-3 * spacing_ * spacing_;
      double sum = 0, least = std::numeric_limits<double>::infinity();
      for (std::size_t i = 0; i < matches_.size(); ++i) {
        sum += matches_[i].squared;
        const double share = static_cast<double>(i + 1) / all;
        if (share < least_share) continue;
        const double cost = (sum / static_cast<double>(i + 1) + floor) / std::pow(share, 2 * share_exponent);
        if (cost >= least) continue;
        least = cost;
        kept = i + 1;
      }
    }
    matches_.resize(
        std::clamp<std::size_t>(kept, std::min<std::size_t>(6, matches_.size()), matches_.size()));
    double squares = 0;
    for (const Match& m : matches_) squares += (m.source - m.reference).squaredNorm();
    scale_ = std::max(spacing_, std::sqrt(squares / static_cast<double>(matches_.size())));
    weights_.assign(matches_.size(), 1);
    drop_disagreeing();
  }

  void weigh() {
    const double tau = std::max(biweight_spacings * spacing_, biweight_rmse * scale_);
    weights_.resize(matches_.size());
    for (std::size_t i = 0; i < matches_.size(); ++i) {
      const double part = 1 - matches_[i].squared / (tau * tau);
      weights_[i] = part > 0 ? part * part : 0;
    }
    drop_disagreeing();
  }

  void drop_disagreeing() {
    if (!normals_) return;
    for (std::size_t i = 0; i < matches_.size(); ++i)
      if (matches_[i].source_normal.dot(matches_[i].reference_normal) < least_cosine) weights_[i] = 0;
  }

  // λ = deviation of positions across the surface / deviation of normals.
  void balance_normals() {
    std::vector<double> across, turned;
    for (std::size_t i = 0; i < matches_.size(); ++i) {
      if (weights_[i] == 0) continue;
      const Match& m = matches_[i];
      across.push_back(
          std::abs((m.source_normal + m.reference_normal).normalized().dot(m.source - m.reference)));
      turned.push_back((m.source_normal - m.reference_normal).norm());
    }
    if (across.size() < 6) return;
    // 1.48 and 0.85 make medians deviations: of a normal variable, of a vector with two of them.
    const double positions = 1.48 * median(across) + 0.1 * spacing_, normals = 0.85 * median(turned) + 0.02;
    rule_.normal_length = std::min(positions / normals, most_normal_length * scale_);
  }

  Pose point_step() const {
    return fit(
        matches_.size(), [&](std::size_t i) { return weights_[i]; },
        [&](std::size_t i) -> const Eigen::Vector3d& { return matches_[i].source; },
        [&](std::size_t i) -> const Eigen::Vector3d& { return matches_[i].reference; });
  }

  Pose plane_step() const {
    Eigen::Vector3d middle = Eigen::Vector3d::Zero();
    double total = 0;
    for (std::size_t i = 0; i < matches_.size(); ++i) {
      middle += weights_[i] * matches_[i].reference;
      total += weights_[i];
    }
    if (!(total > 0)) return {};
    middle /= total;
    // Lengths in spacings, so that the turn and the shift are of a size and units mean nothing.
    Matrix6 A = Matrix6::Zero();
    Vector6 b = Vector6::Zero();
    const auto add = [&](const Eigen::Vector3d& turn, const Eigen::Vector3d& shift, double weight,
                         double residual) {
      Vector6 row;
      row << turn, shift;
      A.selfadjointView<Eigen::Lower>().rankUpdate(row, weight);
      b += weight * residual * row;
    };
    const double lambda = rule_.normal_length / spacing_;
    for (std::size_t i = 0; i < matches_.size(); ++i) {
      if (weights_[i] == 0) continue;
      const Match& m = matches_[i];
      const Eigen::Vector3d p = (m.source - middle) / spacing_, gap = (m.reference - m.source) / spacing_;
      const Eigen::Vector3d n = (m.source_normal + m.reference_normal).normalized();
      const Eigen::Vector3d turned = m.reference_normal - m.source_normal;
      add(p.cross(n), n, weights_[i], n.dot(gap));
      for (int a = 0; a < 3; ++a) {
        const Eigen::Vector3d axis = Eigen::Vector3d::Unit(a);
        add(p.cross(axis), axis, slide * weights_[i], gap[a]);
        add(m.source_normal.cross(axis), Eigen::Vector3d::Zero(), lambda * lambda * weights_[i], turned[a]);
      }
    }
    A.diagonal().array() += 1e-12 * A.trace();
    const Vector6 x = A.selfadjointView<Eigen::Lower>().ldlt().solve(b);
    if (!x.allFinite()) return {};
    const Eigen::Vector3d turn = x.head<3>();
    const double angle = turn.norm();
    Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
    if (angle > 0) R = Eigen::AngleAxisd(std::min(angle, most_turn), turn / angle).toRotationMatrix();
    return pose_of(R, middle + spacing_ * x.tail<3>() - R * middle);
  }

  /// How far it moves the farthest point, at most.
  double size_of(const Pose& step) const {
    const Eigen::Matrix3d turn = rotation_of(step) - Eigen::Matrix3d::Identity();
    return turn.norm() * radius_ + vector(step.translation).norm();
  }

  const Surface &source_, &reference_;
  const SurfaceIcpOptions options_;
  SurfaceIcpResult& result_;
  bool normals_ = false, fine_ = false;
  double spacing_ = 0, radius_ = 0;
  double scale_ = 0;  ///< root mean square of the kept matches' distances, a spacing at least
  MatchRule rule_;
  std::vector<Match> matches_;
  std::vector<double> weights_;
};

}  // namespace

std::unique_ptr<Stepper> surface_icp(const Surface& source, const Surface& reference, const Pose& start,
                                     const SurfaceIcpOptions& options, SurfaceIcpResult& result) {
  return std::make_unique<Aligner>(source, reference, start, options, result);
}

}  // namespace bitr::refine
