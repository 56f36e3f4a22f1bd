#include "cpu/constant_gradient.hpp"
#include "cpu/convolve.hpp"
#include "cpu/neighbour_scatter.hpp"

namespace bitr::cpu {
namespace {

enum : int { features_input, index_input, lengths_input, directions_input };

// In double whatever T is: harmonics and their derivatives cost more than their rounding.
using Matrix = Eigen::MatrixXd;
using Block = ConvolveBlock<double>;

// The derivative of ⟨weights, Y⟩ along the direction's three components, (y, z, x). Exact: on polynomials of
// degree 4 the five-point formula has no error, whatever the step.
Eigen::Vector3d direction_gradient(const Eigen::Vector3d& yzx, const Harmonics<double>& weights) {
  static_assert(irreps::max_harmonic_degree <= 4);
  Eigen::Vector3d gradient;
  for (int i = 0; i < 3; ++i) {
    const auto at = [&](double step) {
      Eigen::Vector3d moved = yzx;
      moved[i] += step;
      return weights.dot(edge_harmonics(moved.data()));
    };
    gradient[i] = (8 * (at(0.5) - at(-0.5)) - (at(1) - at(-1))) / 6;
  }
  return gradient;
}

template <class T>
class ConvolveGradient : public Kernel<T> {
 public:
  explicit ConvolveGradient(const ops::Gradient<ops::Convolve>& op) : op_(op), blocks_(op_.op) {}

  void run(const Arguments& args) const override {
    const GradientSlots<ops::Convolve> slots{op_, args};
    const Slot &index = slots.in(index_input), &features = slots.in(features_input);
    const std::size_t rows = args.rows(index), k = index.per_row;
    std::vector<T> edges(slots.grad_input(features_input) ? rows * k * features.stride() : 0);
    const auto body = [&](std::size_t begin, std::size_t end, ops::Convolve& constants) {
      constexpr std::size_t at_once = 8;
      for (std::size_t row = begin; row < end; row += at_once)
        run_edges(slots, row * k, (std::min(end, row + at_once) - row) * k, constants, edges);
    };
    ops::Convolve constants = sum_constants(args, op_.op, rows, at_least, body);
    store_constants<T>(slots.constants(), constants);
    if (const Slot* to = slots.grad_input(features_input))
      scatter_to_neighbors(args, index, edges.data(), *to);
  }

 private:
  static constexpr std::size_t at_least = 8;

  // What the edges [e0, e0 + count) read and hand back; a column per edge.
  struct Edges {
    Matrix lengths, directions, grad_output;
    Matrix d_lengths, d_features;
    std::vector<Harmonics<double>> harmonics, d_harmonics;  // sides · edges
  };

  static Matrix load(const Slot& slot, std::size_t first, std::size_t count) {
    return Eigen::Map<const Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic>>(
               slot.as<T>() + first * slot.width, slot.width, static_cast<Eigen::Index>(count))
        .template cast<double>();
  }
  static void store(const Matrix& columns, std::size_t first, T* to) {
    Eigen::Map<Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic>>(to + first * columns.rows(), columns.rows(),
                                                                 columns.cols()) = columns.cast<T>();
  }

  void run_edges(const GradientSlots<ops::Convolve>& slots, std::size_t e0, std::size_t count,
                 ops::Convolve& constants, std::vector<T>& edge_features) const {
    const int sides = op_.op.sides;
    const Slot& features = slots.in(features_input);
    const auto* index = slots.in(index_input).template as<std::uint32_t>() + e0;
    const Slot* grad_output = slots.grad_output(0);
    Edges edges{.lengths = load(slots.in(lengths_input), e0, count),
                .directions = load(slots.in(directions_input), e0, count),
                .grad_output = grad_output ? load(*grad_output, e0, count)
                                           : Matrix(Matrix::Zero(op_.op.fiber_out.size(), count)),
                .d_lengths = Matrix::Zero(sides, count),
                .d_features = Matrix::Zero(features.width, count),
                .harmonics = {},
                .d_harmonics = std::vector<Harmonics<double>>(sides * count, Harmonics<double>::Zero())};
    for (std::size_t i = 0; i < sides * count; ++i)
      edges.harmonics.push_back(edge_harmonics(edges.directions.data() + 3 * i));
    Matrix neighbors(features.width, count);
    for (std::size_t e = 0; e < count; ++e) neighbors.col(e) = load(features, index[e], 1);

    std::size_t i = 0;
    for (const Block& block : blocks_) run_block(block, neighbors, constants.blocks[i++], edges);

    if (!edge_features.empty()) store(edges.d_features, e0, edge_features.data());
    if (const Slot* to = slots.grad_input(lengths_input)) store(edges.d_lengths, e0, to->as<T>());
    if (const Slot* to = slots.grad_input(directions_input)) {
      Matrix d_directions(3 * sides, count);
      for (std::size_t n = 0; n < sides * count; ++n)
        Eigen::Map<Eigen::Vector3d>(d_directions.data() + 3 * n) = direction_gradient(
            Eigen::Map<const Eigen::Vector3d>(edges.directions.data() + 3 * n), edges.d_harmonics[n]);
      store(d_directions, e0, to->as<T>());
    }
  }

  void run_block(const Block& block, const Matrix& neighbors, const ops::RadialBlock& constants,
                 Edges& edges) const {
    const ops::RadialBlock& r = block.radial;
    const std::size_t sides = op_.op.sides;
    const Matrix radial = evaluate_block(r, *block.network, edges.lengths);
    Matrix d_radial(radial.rows(), radial.cols()), turned;
    typename Block::Matrices first, second, d_first, d_second;
    for (Eigen::Index e = 0; e < radial.cols(); ++e) {
      const auto *one = &edges.harmonics[e * sides], *two = sides == 2 ? one + 1 : nullptr;
      block.kernels(*one, two, first, second);
      const double* feature = neighbors.col(e).data() + block.in_offset;
      block.turn(first, second, feature, turned);
      const Eigen::Map<const Matrix> weights(radial.col(e).data(), turned.cols(), r.out_channels);
      const Eigen::Map<const Matrix> out(edges.grad_output.col(e).data() + block.out_offset, r.out.dim(),
                                         r.out_channels);
      Eigen::Map<Matrix>(d_radial.col(e).data(), turned.cols(), r.out_channels).noalias() =
          turned.transpose() * out;
      turn_gradient(block, first, second, feature, out * weights.transpose(),
                    edges.d_features.col(e).data() + block.in_offset, d_first, d_second);
      block.first.add_gradient(d_first, edges.d_harmonics[e * sides]);
      if (sides == 2) block.second.add_gradient(d_second, edges.d_harmonics[e * sides + 1]);
    }
    add_block_gradient(r, *block.network, edges.lengths, d_radial, edges.d_lengths,
                       const_cast<ops::RadialNetwork&>(*constants.network));
  }

  static void turn_gradient(const Block& block, const Block::Matrices& first, const Block::Matrices& second,
                            const double* feature, const Matrix& d_turned, double* d_feature,
                            Block::Matrices& d_first, Block::Matrices& d_second) {
    const ops::RadialBlock& r = block.radial;
    const int rows_in = 2 * r.in.p + 1, cols_in = 2 * r.in.q + 1;
    d_first.assign(first.size(), Matrix::Zero(first[0].rows(), first[0].cols()));
    d_second.assign(second.size(), Matrix::Zero(second[0].rows(), second[0].cols()));
    Eigen::Index column = 0;
    for (int c = 0; c < r.in_channels; ++c) {
      const Eigen::Map<const RowMatrix<double>> f(feature + c * rows_in * cols_in, rows_in, cols_in);
      Eigen::Map<RowMatrix<double>> d_f(d_feature + c * rows_in * cols_in, rows_in, cols_in);
      for (std::size_t a = 0; a < first.size(); ++a)
        for (std::size_t b = 0; b < second.size(); ++b) {
          const Eigen::Map<const RowMatrix<double>> d(d_turned.col(column++).data(), 2 * r.out.p + 1,
                                                      2 * r.out.q + 1);
          d_f += first[a].transpose() * d * second[b];
          d_first[a] += d * second[b] * f.transpose();
          d_second[b] += d.transpose() * first[a] * f;
        }
    }
  }

  const ops::Gradient<ops::Convolve> op_;
  const ConvolveBlocks<double> blocks_;
};

}  // namespace

template <>
KernelPtr<float> make_kernel(const ops::Gradient<ops::Convolve>& op) {
  return std::make_unique<ConvolveGradient<float>>(op);
}
template <>
KernelPtr<double> make_kernel(const ops::Gradient<ops::Convolve>& op) {
  return std::make_unique<ConvolveGradient<double>>(op);
}

}  // namespace bitr::cpu
