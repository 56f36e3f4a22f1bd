#include "refine/vulkan_plans.hpp"

#include <algorithm>
#include <cmath>
#include <map>

namespace bitr::refine {
namespace {

static_assert(BlockedPoints::block == vk::Sinkhorn::block);

struct Box {
  Eigen::Array3d low, high;
};

Box box_of(const BlockedPoints& points) {
  return {points.rows().leftCols<3>().colwise().minCoeff().transpose(),
          points.rows().leftCols<3>().colwise().maxCoeff().transpose()};
}

double slack_of(const PlanWanted& wanted) {
  return wanted.stage.affinity.beta * wanted.stage.affinity.alpha / 2;
}

/// Where the device has the origin, and how long its unit is.
struct DeviceFrame {
  Eigen::Array3d origin;
  double scale;
  explicit DeviceFrame(const PlanWanted& wanted) : scale(std::sqrt(wanted.stage.affinity.beta)) {
    const Box box = box_of(wanted.plan.reference());
    origin = (box.low + box.high) / 2;
  }
};

void write(const BlockedPoints& points, const DeviceFrame& frame, std::size_t stride, float* rows,
           float* boxes) {
  const auto at = [&](double x, int a) { return static_cast<float>((x - frame.origin[a]) * frame.scale); };
  const Eigen::ArrayXXd& from = points.rows();
  for (std::size_t i = 0; i < points.size(); ++i, rows += stride) {
    const auto row = static_cast<Eigen::Index>(i);
    for (int a = 0; a < 3; ++a) {
      rows[a] = at(from(row, a), a);
      if (from.cols() > 3) rows[4 + a] = static_cast<float>(from(row, 3 + a) * frame.scale);
    }
  }
  for (std::size_t b = 0; b < points.blocks(); ++b, boxes += 8)
    for (int a = 0; a < 3; ++a) {
      boxes[a] = at(points.low(b)[a], a);
      boxes[4 + a] = at(points.high(b)[a], a);
    }
}

void read(PlanWanted& wanted, const DeviceFrame& frame, const float* moments) {
  const Eigen::ArrayXXd& rows = wanted.plan.source().rows();
  wanted.weights.resize(rows.rows());
  wanted.targets.resize(rows.rows(), rows.cols());
  for (Eigen::Index i = 0; i < rows.rows(); ++i, moments += 8) {
    wanted.weights[i] = moments[0];
    for (Eigen::Index c = 0; c < rows.cols(); ++c)
      wanted.targets(i, c) = moments[0] * rows(i, c) + moments[1 + c] / frame.scale;
  }
}

}  // namespace

bool VulkanPlans::fits(const PlanWanted& wanted) {
  const BlockedPoints &source = wanted.plan.source(), &reference = wanted.plan.reference();
  if (std::max(source.size(), reference.size()) > vk::Sinkhorn::most_points) return false;
  const Box a = box_of(source), b = box_of(reference);
  const double apart = (a.high.max(b.high) - a.low.min(b.low)).matrix().norm();
  return std::sqrt(wanted.stage.affinity.beta) * apart <= vk::Sinkhorn::most_distance &&
         std::abs(slack_of(wanted)) <= vk::Sinkhorn::most_slack;
}

void VulkanPlans::run(std::span<PlanWanted* const> plans) {
  // What a shader or a submission has in common.
  std::map<std::pair<bool, int>, std::vector<PlanWanted*>> groups;
  std::vector<PlanWanted*> left;
  for (PlanWanted* wanted : plans)
    (fits(*wanted) ? groups[{wanted->stage.normal_length > 0, wanted->stage.sinkhorn.most_iterations}] : left)
        .push_back(wanted);
  for (const auto& [_, group] : groups) run_together(group);
  pool_.parallel_for(left.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) solve(*left[i]);
  });
}

void VulkanPlans::run_together(std::span<PlanWanted* const> plans) {
  std::vector<vk::Sinkhorn::Problem> problems;
  for (const PlanWanted* wanted : plans)
    problems.push_back({static_cast<std::uint32_t>(wanted->plan.source().size()),
                        static_cast<std::uint32_t>(wanted->plan.reference().size()), slack_of(*wanted),
                        wanted->stage.sinkhorn.tolerance});
  sinkhorn_.lay_out(problems, plans.front()->plan.source().rows().cols() > 3);
  const auto each = [&](const auto& visit) {
    pool_.parallel_for(plans.size(), 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) visit(i, *plans[i], DeviceFrame(*plans[i]));
    });
  };
  each([&](std::size_t i, PlanWanted& wanted, const DeviceFrame& frame) {
    const std::size_t stride = sinkhorn_.numbers_per_point();
    write(wanted.plan.source(), frame, stride, sinkhorn_.sources(i), sinkhorn_.source_boxes(i));
    write(wanted.plan.reference(), frame, stride, sinkhorn_.references(i), sinkhorn_.reference_boxes(i));
    Eigen::ArrayXd& v = wanted.plan.column_potentials();
    if (!wanted.warm) v.setZero();
    for (std::uint32_t j = 0; j < v.size(); ++j) sinkhorn_.set_potential(i, j, v[j] + problems[i].slack);
  });
  sinkhorn_.run(plans.front()->stage.sinkhorn.most_iterations);
  each([&](std::size_t i, PlanWanted& wanted, const DeviceFrame& frame) {
    read(wanted, frame, sinkhorn_.moments(i));
    Eigen::ArrayXd& v = wanted.plan.column_potentials();
    for (std::uint32_t j = 0; j < v.size(); ++j) v[j] = sinkhorn_.potential(i, j) - problems[i].slack;
  });
}

}  // namespace bitr::refine
