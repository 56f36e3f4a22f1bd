#include "cpu/point_attention_gradient.hpp"

#include "cpu/constant_gradient.hpp"
#include "cpu/point_block.hpp"

namespace bitr::cpu {
namespace {

// Lanes are added up in double at least this often.
constexpr std::size_t rows_between_flushes = 1024;

}  // namespace

template <class T>
void point_attention_gradient(const Arguments& args, const ops::PointAttention& op, graph::Rows queries,
                              int k, const PointInputs<T>& in, const T* grad_output, const T* coefficients,
                              const PointGradients<T>& out) {
  const graph::BatchLayout& layout = args.layout;
  const std::size_t width = op.c0 + 3 * op.c1;
  const PointMatrices shared = matrices_of(op);
  std::vector<PointMatrices> sums(layout.clouds());
  const auto clear = [](T* to, std::size_t begin, std::size_t end, std::size_t size) {
    if (to) std::fill(to + begin * size, to + end * size, T{0});
  };
  // A cloud's neighbours are its own points.
  const auto differentiate = [&](std::uint32_t cloud) {
    const std::size_t begin = layout.begin(queries, cloud), end = layout.begin(queries, cloud + 1);
    const std::size_t first = layout.begin(graph::Rows::point, cloud),
                      last = layout.begin(graph::Rows::point, cloud + 1);
    clear(out.features, first, last, width);
    clear(out.neighbors, first, last, 3);
    clear(out.centres, begin, end, 3);
    const PointMatrices matrices =
        coefficients ? with_coefficients(shared, op, coefficients + cloud * op.coefficient_count()) : shared;
    sums[cloud] = zeros_like(matrices);
    PointBlock<T> block(op, matrices, in, grad_output, k);
    for (std::size_t chunk = begin; chunk < end; chunk += rows_between_flushes) {
      const std::size_t chunk_end = std::min(chunk + rows_between_flushes, end);
      for (std::size_t row = chunk; row < chunk_end; row += pack_lanes<T>)
        block.differentiate(row, std::min<std::size_t>(row + pack_lanes<T>, chunk_end), out);
      block.flush(sums[cloud]);
    }
    if (!out.coefficients) return;
    T* to = out.coefficients + cloud * op.coefficient_count();
    for (PointMatrix name : per_cloud_matrices) {
      const Eigen::MatrixXd& sum = sums[cloud][name];
      Eigen::Map<RowMatrix<T>>(to, sum.rows(), sum.cols()) = sum.cast<T>();
      to += sum.size();
    }
  };
  args.pool.parallel_for(layout.clouds(), 1, [&](std::size_t from, std::size_t to) {
    for (std::size_t cloud = from; cloud < to; ++cloud) differentiate(static_cast<std::uint32_t>(cloud));
  });
  if (!out.constants) return;
  for (std::uint32_t cloud = 1; cloud < layout.clouds(); ++cloud)
    for (int i = 0; i < point_matrices; ++i) sums[0][i] += sums[cloud][i];
  ops::PointAttention gradient = gradient_of(op, sums[0]);
  store_constants<T>(out.constants, gradient);
}

template void point_attention_gradient(const Arguments&, const ops::PointAttention&, graph::Rows, int,
                                       const PointInputs<float>&, const float*, const float*,
                                       const PointGradients<float>&);
template void point_attention_gradient(const Arguments&, const ops::PointAttention&, graph::Rows, int,
                                       const PointInputs<double>&, const double*, const double*,
                                       const PointGradients<double>&);

namespace {

template <class T>
class PointAttentionGradient : public Kernel<T> {
 public:
  explicit PointAttentionGradient(const ops::Gradient<ops::PointAttention>& op) : op_(op) {}

  void run(const Arguments& args) const override {
    const GradientSlots<ops::PointAttention> slots{op_, args};
    const Slot &features = slots.in(0), &edges = slots.in(1);
    const auto to = [](const Slot* slot) { return slot ? slot->as<T>() : nullptr; };
    point_attention_gradient<T>(args, op_.op, edges.rows, edges.per_row,
                                {features.as<T>(), features.stride(), edges.as<std::uint32_t>(),
                                 slots.in(2).as<T>(), slots.in(3).as<T>(), nullptr},
                                slots.grad_output(0)->as<T>(),
                                op_.op.per_cloud ? slots.in(4).as<T>() : nullptr,
                                {to(slots.grad_input(0)), to(slots.grad_input(2)), to(slots.grad_input(3)),
                                 op_.op.per_cloud ? to(slots.grad_input(4)) : nullptr, slots.constants()});
  }

 private:
  const ops::Gradient<ops::PointAttention> op_;
};

}  // namespace

template <>
KernelPtr<float> make_kernel(const ops::Gradient<ops::PointAttention>& op) {
  return std::make_unique<PointAttentionGradient<float>>(op);
}
template <>
KernelPtr<double> make_kernel(const ops::Gradient<ops::PointAttention>& op) {
  return std::make_unique<PointAttentionGradient<double>>(op);
}

}  // namespace bitr::cpu
