#include "generate/compound.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "generate/solid.hpp"

namespace bitr::generate {
namespace {

using Eigen::Vector3d;

// A primitive bulges beyond its grid by less than this share of its size.
constexpr double bulge = 0.01;

}  // namespace

std::vector<Vector3d> Compound::measure(std::size_t member) {
  const Primitive& primitive = *members_[member].primitive;
  const int rows = primitive.rows(), columns = primitive.columns();
  std::vector<Vector3d> grid = primitive.corners();
  Box& box = members_[member].box;
  for (const Vector3d& at : grid) box.include(at);
  const Vector3d margin = Vector3d::Constant(bulge * (box.high - box.low).maxCoeff());
  box.low -= margin;
  box.high += margin;

  const auto corner = [&](int i, int j) -> const Vector3d& {
    return grid[static_cast<std::size_t>(i) * (columns + 1) + j];
  };
  double weight = cells_.empty() ? 0 : cells_.back().weight_up_to;
  for (int i = 0; i < rows; ++i)
    for (int j = 0; j < columns; ++j) {
      const Vector3d up[] = {corner(i + 1, j) - corner(i, j), corner(i + 1, j + 1) - corner(i, j + 1)};
      const Vector3d across[] = {corner(i, j + 1) - corner(i, j), corner(i + 1, j + 1) - corner(i + 1, j)};
      double largest = 0;
      for (const Vector3d& u : up)
        for (const Vector3d& a : across) largest = std::max(largest, u.cross(a).squaredNorm());
      if (largest == 0) continue;
      // Area per cell at the corners; in between, where the surface bends, it is a little more.
      weight += 1.15 * std::sqrt(largest);
      cells_.push_back({weight, static_cast<std::uint16_t>(member), static_cast<std::uint16_t>(i),
                        static_cast<std::uint16_t>(j)});
    }
  return grid;
}

void Compound::finish(std::optional<Vector3d> middle) {
  std::vector<Vector3d> outline;
  Box box;
  for (std::size_t m = 0; m < members_.size(); ++m) {
    const std::vector<Vector3d> grid = measure(m);
    if (!members_[m].hollow) outline.insert(outline.end(), grid.begin(), grid.end());
  }
  for (const Vector3d& at : outline) box.include(at);
  middle_ = middle.value_or((box.low + box.high) / 2);
  double reach = 0;
  for (const Vector3d& at : outline) reach = std::max(reach, (at - middle_).squaredNorm());
  scale_ = solid_radius / (1 + bulge) / std::sqrt(reach);

  for (Member& member : members_)
    for (std::size_t i = 0; i < members_.size(); ++i)
      if (&member != &members_[i] && member.box.meets(members_[i].box))
        member.around.push_back(static_cast<std::uint16_t>(i));
  for (std::size_t i = 0, cell = 0; i < cells_.size(); ++i) {
    const double share = static_cast<double>(i) / static_cast<double>(cells_.size());
    while (cells_[cell].weight_up_to <= share * cells_.back().weight_up_to) ++cell;
    guide_.push_back(static_cast<std::uint32_t>(cell));
  }
}

std::size_t Compound::pick(double share) const {
  const double weight = share * cells_.back().weight_up_to;
  std::size_t cell = guide_[static_cast<std::size_t>(share * static_cast<double>(cells_.size()))];
  while (cells_[cell].weight_up_to <= weight && cell + 1 < cells_.size()) ++cell;
  return cell;
}

bool Compound::inside(const Vector3d& at) const {
  const Vector3d local = at / scale_ + middle_;
  bool within = false;
  for (const Member& member : members_) {
    if (within && !member.hollow) continue;
    if (!member.contains(local)) continue;
    if (member.hollow) return false;
    within = true;
  }
  return within;
}

bool Compound::exposed(const Vector3d& at, std::size_t member) const {
  bool within = false;
  for (const std::size_t i : members_[member].around) {
    if ((within && !members_[i].hollow) || !members_[i].contains(at)) continue;
    if (members_[i].hollow || !members_[member].hollow) return false;
    within = true;
  }
  return within == members_[member].hollow;
}

void Compound::trial(Random& random, std::vector<SurfacePoint>& points) const {
  const std::size_t found = pick(random.uniform());
  const Cell& cell = cells_[found];
  const double bound = cell.weight_up_to - (found ? cells_[found - 1].weight_up_to : 0);
  const Member& member = members_[cell.member];

  const double row = random.uniform(), column = random.uniform(), accept = random.uniform();
  const auto [at, by_row, by_column] = member.primitive->place(cell.row + row, cell.column + column);
  const Vector3d outwards = by_column.cross(by_row);
  const double area = outwards.norm();
  if (!(accept * bound < area) || !exposed(at, cell.member)) return;
  points.push_back({scale_ * (at - middle_), (member.hollow ? -outwards : outwards) / area});
}

}  // namespace bitr::generate
