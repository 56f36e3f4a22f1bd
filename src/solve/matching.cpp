#include "solve/matching.hpp"

#include <algorithm>
#include <limits>

namespace bitr::solving {
namespace {

struct Nearest {
  std::vector<float> distance;  ///< squared
  std::vector<std::uint32_t> index;
  explicit Nearest(std::size_t n = 0) : distance(n, std::numeric_limits<float>::infinity()), index(n, 0) {}
};

constexpr Eigen::Index wide = 256, deep = 256;

// One block of columns of `from` against all of `to`: what each finds nearest there, in `there`, and which of the
// block each of `to` finds nearest, in `back`.
void compare(const Descriptors& from, const Descriptors& to, const Eigen::VectorXf& from_lengths,
             const Eigen::VectorXf& to_lengths, Eigen::Index first, Nearest& there, Nearest& back) {
  const Eigen::Index count = std::min(wide, from.cols() - first);
  const Eigen::MatrixXf scaled = -2 * from.middleCols(first, count);
  Eigen::MatrixXf product;
  for (Eigen::Index row = 0; row < to.cols(); row += deep) {
    const Eigen::Index rows = std::min(deep, to.cols() - row);
    product.noalias() = to.middleCols(row, rows).transpose() * scaled;
    for (Eigen::Index c = 0; c < count; ++c) {
      auto column = product.col(c);
      column += to_lengths.segment(row, rows);
      column.array() += from_lengths[first + c];
      const auto at = static_cast<std::size_t>(first + c);
      if (const float least = column.minCoeff(); least < there.distance[at]) {
        const float* data = column.data();
        there.distance[at] = least;
        there.index[at] = static_cast<std::uint32_t>(row + (std::find(data, data + rows, least) - data));
      }
      float* distance = &back.distance[static_cast<std::size_t>(row)];
      std::uint32_t* index = &back.index[static_cast<std::size_t>(row)];
      const auto column_index = static_cast<std::uint32_t>(first + c);
      for (Eigen::Index r = 0; r < rows; ++r) {
        const bool nearer = column[r] < distance[r];
        distance[r] = nearer ? column[r] : distance[r];
        index[r] = nearer ? column_index : index[r];
      }
    }
  }
}

}  // namespace

std::vector<Pairing> mutual_nearest(const Descriptors& source, const Descriptors& reference,
                                    ThreadPool& pool) {
  std::vector<Pairing> pairings;
  const auto n = static_cast<std::size_t>(source.cols()), m = static_cast<std::size_t>(reference.cols());
  if (n == 0 || m == 0) return pairings;
  const Eigen::VectorXf source_lengths = source.colwise().squaredNorm(),
                        reference_lengths = reference.colwise().squaredNorm();
  Nearest there(n), back(m);
  // Blocks are the same for any number of threads, and put together in their order.
  std::vector<Nearest> backs((n + wide - 1) / wide);
  pool.parallel_for(backs.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t b = begin; b < end; ++b) {
      backs[b] = Nearest(m);
      compare(source, reference, source_lengths, reference_lengths, static_cast<Eigen::Index>(b) * wide,
              there, backs[b]);
    }
  });
  for (const Nearest& block : backs)
    for (std::size_t j = 0; j < m; ++j)
      if (block.distance[j] < back.distance[j]) {
        back.distance[j] = block.distance[j];
        back.index[j] = block.index[j];
      }
  for (std::uint32_t i = 0; i < n; ++i)
    if (back.index[there.index[i]] == i) pairings.push_back({i, there.index[i], there.distance[i]});
  return pairings;
}

}  // namespace bitr::solving
