#include "refine/icp.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "core/point_tree.hpp"
#include "refine/rigid_fit.hpp"

namespace bitr::refine {

struct Icp::Index {
  std::vector<Vec3d> points;
  PointRows rows{points};
  PointTree tree{3, rows, {10}};
  std::size_t bytes;
  explicit Index(const std::vector<Vec3d>& reference)
      : points(reference), bytes(points.size() * sizeof(Vec3d) + tree.usedMemory(tree)) {}
};

Icp::Icp(const std::vector<Vec3d>& reference, const IcpOptions& options)
    : index_(std::make_unique<const Index>(reference)), options_(options) {}
Icp::~Icp() = default;

class Icp::Steps : public Stepper {
  struct Matched {
    double squared;
    std::uint32_t source, reference;
    bool operator<(const Matched& other) const {
      return squared < other.squared || (squared == other.squared && source < other.source);
    }
  };

 public:
  Steps(const Icp& icp, const std::vector<Vec3d>& source, const Pose& start, IcpResult& result)
      : index_(*icp.index_),
        options_(icp.options_),
        source_(source),
        matches_(source.size()),
        result_(result) {
    const std::size_t fewer = std::min(source.size(), index_.points.size());
    kept_ = std::clamp<std::size_t>(static_cast<std::size_t>(options_.keep * static_cast<double>(fewer)),
                                    std::min<std::size_t>(3, fewer), fewer);
    result_ = {};
    result_.T_reference_source = start;
    result_.workspace_bytes = index_.bytes + matches_.size() * sizeof(Matched);
  }

  Wanted wanted() override {
    if (result_.iterations >= options_.most_iterations || result_.converged) return {};
    Wanted wanted;
    wanted.searches.push_back(
        {.in = index_.points,
         .tree = index_.tree,
         .from = &source_,
         .count = source_.size(),
         .point = [this](std::size_t i) { return result_.T_reference_source.apply(source_[i]); },
         .take =
             [this](std::size_t i, const std::uint32_t* index, const double* squared, std::size_t) {
               matches_[i] = {*squared, static_cast<std::uint32_t>(i), *index};
             }});
    return wanted;
  }

  void step() override {
    ++result_.iterations;
    std::nth_element(matches_.begin(), matches_.begin() + (kept_ - 1), matches_.end());
    double squares = 0;
    for (std::size_t i = 0; i < kept_; ++i) squares += matches_[i].squared;
    result_.rmse = std::sqrt(squares / static_cast<double>(kept_));
    const Pose next = fit(
        kept_, [](std::size_t) { return 1.0; },
        [&](std::size_t i) { return vector(source_[matches_[i].source]); },
        [&](std::size_t i) { return vector(index_.points[matches_[i].reference]); });
    const double moved = absolute_change(next, result_.T_reference_source);
    result_.T_reference_source = next;
    result_.converged = moved < options_.tolerance;
  }

 private:
  const Index& index_;
  const IcpOptions options_;
  const std::vector<Vec3d>& source_;
  std::vector<Matched> matches_;
  std::size_t kept_ = 0;
  IcpResult& result_;
};

std::unique_ptr<Stepper> Icp::stepper(const std::vector<Vec3d>& source, const Pose& start,
                                      IcpResult& result) const {
  return std::make_unique<Steps>(*this, source, start, result);
}

IcpResult Icp::align(const std::vector<Vec3d>& source, const Pose& start) const {
  IcpResult result;
  Steps steps(*this, source, start, result);
  drive(steps, {});
  return result;
}

}  // namespace bitr::refine
