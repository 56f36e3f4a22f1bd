// The official code's refinements, from the measured tensors.
#pragma once

#include <bitr/cloud.hpp>
#include <bitr/pose.hpp>

#include "support/golden.hpp"

namespace bitr::test {

class GoldenRefinement {
 public:
  /// "icp0", "icp1" or "ot0".
  explicit GoldenRefinement(std::string name) : name_(std::move(name)) {}

  std::vector<double> values(const std::string& suffix) const {
    return tensors_.tensors.at(name_ + "." + suffix).to_double();
  }
  PointCloud cloud(const std::string& suffix) const {
    const std::vector<double> flat = values(suffix);
    PointCloud cloud;
    cloud.positions.resize(flat.size() / 3);
    for (std::size_t i = 0; i < flat.size(); ++i) cloud.positions[i / 3][i % 3] = flat[i];
    return cloud;
  }
  Pose pose(const std::string& suffix) const {
    const std::vector<double> R = values("R" + suffix), t = values("t" + suffix);
    Pose pose;
    std::copy(R.begin(), R.end(), pose.rotation.begin());
    std::copy(t.begin(), t.end(), pose.translation.begin());
    return pose;
  }

 private:
  std::string name_;
  TensorMap tensors_ = read_tensors(golden_path("refine.safetensors"));
};

}  // namespace bitr::test
