#include "page/normals.hpp"

#include <Eigen/Eigenvalues>

namespace bitr::view {

std::vector<Vec3f> fitted_normals(const PointTree& tree, const std::vector<Vec3d>& points) {
  constexpr std::size_t most = 12;
  std::vector<Vec3f> normals(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    std::uint32_t index[most];
    double squared[most];
    const std::size_t found = tree.knnSearch(points[i].data(), most, index, squared);
    // In units of the neighbourhood, so that no square over- or underflows.
    const double reach = found > 1 && squared[found - 1] > 0 ? std::sqrt(squared[found - 1]) : 1;
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
    for (std::size_t j = 0; j < found; ++j) {
      const Eigen::Vector3d x =
          (Eigen::Vector3d(points[index[j]].data()) - Eigen::Vector3d(points[i].data())) / reach;
      sum += x;
      moments += x * x.transpose();
    }
    const Eigen::Matrix3d spread = moments - sum * sum.transpose() / static_cast<double>(found);
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
    solver.computeDirect(spread);
    const Eigen::Vector3f normal = solver.eigenvectors().col(0).cast<float>();
    normals[i] = {normal[0], normal[1], normal[2]};
  }
  return normals;
}

}  // namespace bitr::view
