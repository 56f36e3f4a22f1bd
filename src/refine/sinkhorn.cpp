#include "refine/sinkhorn.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/halves.hpp"

namespace bitr::refine {
namespace {

constexpr Eigen::Index block = BlockedPoints::block;
constexpr std::size_t rows_a_task = 64;
// exp(−50) is 2e-22: below rounding even when 10,000 such terms meet.
constexpr double negligible = 50;

/// A row of all coordinates.
using Point = Eigen::Array<double, Eigen::Dynamic, 1, 0, 6, 1>;

/// From positions alone: no more than from all coordinates.
double squared_distance(const Point& point, const Vec3d& low, const Vec3d& high) {
  double sum = 0;
  for (int a = 0; a < 3; ++a) {
    const double out = std::max({low[a] - point[a], point[a] - high[a], 0.0});
    sum += out * out;
  }
  return sum;
}

using Segment = Eigen::Array<double, Eigen::Dynamic, 1, 0, BlockedPoints::block, 1>;

Eigen::Index size_of_block(const BlockedPoints& points, std::size_t b) {
  return std::min<Eigen::Index>(
      block, static_cast<Eigen::Index>(points.size()) - static_cast<Eigen::Index>(b) * block);
}

/// β(α − |point − row|²) + potential of every row in block b.
Segment log_terms(const Point& point, const BlockedPoints& points, std::size_t b,
                  const Eigen::ArrayXd& potential, const Affinity& affinity) {
  const Eigen::Index from = static_cast<Eigen::Index>(b) * block, count = size_of_block(points, b);
  const auto rows = points.rows().middleRows(from, count);
  Segment within = affinity.alpha - (rows.col(0) - point[0]).square() - (rows.col(1) - point[1]).square() -
                   (rows.col(2) - point[2]).square();
  for (Eigen::Index c = 3; c < rows.cols(); ++c) within -= (rows.col(c) - point[c]).square();
  return affinity.beta * within + potential.segment(from, count);
}

std::vector<double> block_maxima(const BlockedPoints& points, const Eigen::ArrayXd& potential) {
  std::vector<double> maxima(points.blocks());
  for (std::size_t b = 0; b < maxima.size(); ++b)
    maxima[b] = potential.segment(static_cast<Eigen::Index>(b) * block, size_of_block(points, b)).maxCoeff();
  return maxima;
}

/// log Σ exp of terms that come block by block.
class LogSum {
 public:
  explicit LogSum(double first) : most_(first) {}
  double most() const { return most_; }
  void add(const Segment& terms) {
    const double most = terms.maxCoeff();
    if (most < most_ - negligible) return;
    if (most > most_) {
      sum_ *= std::exp(most_ - most);
      most_ = most;
    }
    sum_ += (terms - most_).exp().sum();
  }
  double value() const { return most_ + std::log(sum_); }

 private:
  double most_, sum_ = 1;
};

/// The potentials of `of` that make each row of the plan, with its slack, sum to 1.
void balance(const BlockedPoints& of, const BlockedPoints& against, const Eigen::ArrayXd& potential,
             const Affinity& affinity, const Workers& workers, Eigen::ArrayXd& result) {
  const std::vector<double> maxima = block_maxima(against, potential);
  workers.parallel_for(of.size(), rows_a_task, [&](std::size_t begin, std::size_t end) {
    std::vector<double> bound(maxima.size());
    for (std::size_t i = begin; i < end; ++i) {
      const Point point = of.rows().row(static_cast<Eigen::Index>(i)).transpose();
      for (std::size_t b = 0; b < bound.size(); ++b)
        bound[b] = maxima[b] + affinity.beta * (affinity.alpha -
                                                squared_distance(point, against.low(b), against.high(b)));
      // The most promising block first: it shows early which others cannot matter.
      const std::size_t best = std::max_element(bound.begin(), bound.end()) - bound.begin();
      LogSum sum(0);  // the slack
      sum.add(log_terms(point, against, best, potential, affinity));
      for (std::size_t b = 0; b < bound.size(); ++b)
        if (b != best && bound[b] >= sum.most() - negligible)
          sum.add(log_terms(point, against, b, potential, affinity));
      result[static_cast<Eigen::Index>(i)] = -sum.value();
    }
  });
}

}  // namespace

BlockedPoints::BlockedPoints(const std::vector<Vec3d>& points, const std::vector<Vec3d>& normals,
                             double normal_length)
    : order_(points.size()),
      at_rest_(static_cast<Eigen::Index>(points.size()), normals.empty() ? 3 : 6),
      low_((points.size() + block - 1) / block),
      high_(low_.size()) {
  std::iota(order_.begin(), order_.end(), 0);
  order_by_halves(points, order_.data(), order_.data() + order_.size(), BlockedPoints::block,
                  [](std::size_t blocks) { return blocks / 2; });
  for (std::size_t i = 0; i < order_.size(); ++i)
    for (int a = 0; a < 3; ++a) {
      const auto row = static_cast<Eigen::Index>(i);
      at_rest_(row, a) = points[order_[i]][a];
      if (!normals.empty()) at_rest_(row, 3 + a) = normal_length * normals[order_[i]][a];
    }
  rows_ = at_rest_;
  measure();
}

void BlockedPoints::move(const Pose& pose) {
  for (Eigen::Index i = 0; i < rows_.rows(); ++i) {
    const Vec3d moved = pose.apply({at_rest_(i, 0), at_rest_(i, 1), at_rest_(i, 2)});
    for (int a = 0; a < 3; ++a) rows_(i, a) = moved[a];
    if (rows_.cols() == 3) continue;
    const Vec3d turned = pose.rotate({at_rest_(i, 3), at_rest_(i, 4), at_rest_(i, 5)});
    for (int a = 0; a < 3; ++a) rows_(i, 3 + a) = turned[a];
  }
  measure();
}

void BlockedPoints::measure() {
  for (std::size_t b = 0; b < low_.size(); ++b) {
    const auto rows = rows_.middleRows(static_cast<Eigen::Index>(b * block), size_of_block(*this, b));
    for (int a = 0; a < 3; ++a) {
      low_[b][a] = rows.col(a).minCoeff();
      high_[b][a] = rows.col(a).maxCoeff();
    }
  }
}

std::size_t BlockedPoints::bytes() const {
  return order_.size() * (sizeof(order_[0]) + 2 * static_cast<std::size_t>(rows_.cols()) * sizeof(double)) +
         2 * low_.size() * sizeof(Vec3d);
}

Sinkhorn::Sinkhorn(BlockedPoints source, BlockedPoints reference, const Workers& workers)
    : workers_(workers), source_(std::move(source)), reference_(std::move(reference)) {
  u_.setZero(static_cast<Eigen::Index>(source_.size()));
  v_.setZero(static_cast<Eigen::Index>(reference_.size()));
}

int Sinkhorn::normalise(const Affinity& affinity, const SinkhornOptions& options, bool warm) {
  affinity_ = affinity;
  if (!warm) {
    u_.setZero();
    v_.setZero();
  }
  Eigen::ArrayXd u(u_.size()), v(v_.size());
  const double fewer = static_cast<double>(std::min(source_.size(), reference_.size()));
  for (int iteration = 1; iteration <= options.most_iterations; ++iteration) {
    balance(source_, reference_, v_, affinity, workers_, u);
    balance(reference_, source_, u, affinity, workers_, v);
    u_.swap(u);
    v_.swap(v);
    if (iteration == 1) continue;
    // P changes by a factor of exp(±change) at most, and all of it is no more than the smaller cloud.
    const double change = (u_ - u).abs().maxCoeff() + (v_ - v).abs().maxCoeff();
    if (change > 1) continue;
    if (fewer * std::expm1(change) < options.tolerance || change_of_plan(u, v) < options.tolerance)
      return iteration;
  }
  return options.most_iterations;
}

template <class Visit>
void Sinkhorn::for_each_row(const Visit& visit) const {
  const std::vector<double> maxima = block_maxima(reference_, v_);
  workers_.parallel_for(source_.size(), rows_a_task, [&](std::size_t begin, std::size_t end) {
    for (std::size_t row = begin; row < end; ++row) {
      const auto i = static_cast<Eigen::Index>(row);
      const Point point = source_.rows().row(i).transpose();
      for (std::size_t b = 0; b < maxima.size(); ++b) {
        const double near = squared_distance(point, reference_.low(b), reference_.high(b));
        if (maxima[b] + affinity_.beta * (affinity_.alpha - near) + u_[i] < -negligible) continue;
        const Segment plan = (log_terms(point, reference_, b, v_, affinity_) + u_[i]).exp();
        visit(i, static_cast<Eigen::Index>(b) * block, plan);
      }
    }
  });
}

double Sinkhorn::change_of_plan(const Eigen::ArrayXd& old_rows, const Eigen::ArrayXd& old_columns) const {
  const Eigen::ArrayXd row_factors = (old_rows - u_).exp(), factors = (old_columns - v_).exp();
  Eigen::ArrayXd changes = Eigen::ArrayXd::Zero(u_.size());
  for_each_row([&](Eigen::Index i, Eigen::Index first, const Segment& plan) {
    changes[i] += (plan * (row_factors[i] * factors.segment(first, plan.size()) - 1)).abs().sum();
  });
  return changes.sum();
}

void Sinkhorn::project(Eigen::ArrayXd& weights, Eigen::ArrayXXd& targets) const {
  weights.setZero(u_.size());
  targets.setZero(u_.size(), reference_.rows().cols());
  for_each_row([&](Eigen::Index i, Eigen::Index first, const Segment& plan) {
    const auto rows = reference_.rows().middleRows(first, plan.size());
    weights[i] += plan.sum();
    for (Eigen::Index c = 0; c < rows.cols(); ++c) targets(i, c) += (plan * rows.col(c)).sum();
  });
}

double Sinkhorn::log_plan(std::size_t source, std::size_t reference) const {
  const auto row = [](const BlockedPoints& points, std::size_t given) {
    return std::find(points.order().begin(), points.order().end(), given) - points.order().begin();
  };
  const auto i = row(source_, source), j = row(reference_, reference);
  return affinity_.beta *
             (affinity_.alpha - (source_.rows().row(i) - reference_.rows().row(j)).square().sum()) +
         u_[i] + v_[j];
}

std::size_t Sinkhorn::bytes() const {
  // Potentials, old and new, and what project() writes.
  const auto columns = static_cast<std::size_t>(source_.rows().cols());
  return source_.bytes() + reference_.bytes() +
         sizeof(double) * ((3 + columns) * source_.size() + 3 * reference_.size());
}

}  // namespace bitr::refine
