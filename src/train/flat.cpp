#include "train/flat.hpp"

#include "core/failure.hpp"

namespace bitr::train {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

std::size_t flat_size(const model::Weights& weights) {
  std::size_t size = 0;
  for (const auto& [name, matrix] : weights.parameters) size += static_cast<std::size_t>(matrix.size());
  return size;
}

std::vector<double> flatten(const model::Weights& weights) {
  std::vector<double> flat(flat_size(weights));
  double* at = flat.data();
  for (const auto& [name, matrix] : weights.parameters) {
    Eigen::Map<RowMajor>(at, matrix.rows(), matrix.cols()) = matrix;
    at += matrix.size();
  }
  return flat;
}

void add_gradients(const model::Weights& weights, const Gradients& gradients, double scale,
                   std::span<double> flat) {
  double* at = flat.data();
  for (const auto& [name, matrix] : weights.parameters) {
    const auto found = gradients.find(name);
    if (found == gradients.end() || found->second.rows() != matrix.rows() ||
        found->second.cols() != matrix.cols())
      throw Failure(ErrorCode::internal, "no gradient of its shape for parameter " + name);
    Eigen::Map<RowMajor>(at, matrix.rows(), matrix.cols()) += scale * found->second;
    at += matrix.size();
  }
}

void unflatten(std::span<const double> flat, model::Weights& weights) {
  const double* at = flat.data();
  for (auto& [name, matrix] : weights.parameters) {
    matrix = Eigen::Map<const RowMajor>(at, matrix.rows(), matrix.cols());
    at += matrix.size();
  }
}

}  // namespace bitr::train
