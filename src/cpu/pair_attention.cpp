#include "cpu/pair_attention.hpp"

namespace bitr::cpu {
namespace {

template <class T>
class PairAttentionKernel : public Kernel<T> {
 public:
  explicit PairAttentionKernel(const ops::PairAttention& op) : constants_(op) {}

  void run(const Arguments& args) const override {
    with_width<8, 16, 24, 32, 64>(args.in[1].per_row, [&](auto width) { run_width<width()>(args); });
  }

 private:
  template <int Width>
  void run_width(const Arguments& args) const {
    const Slot &features = args.in[0], &edges = args.in[1], &out = args.out[0];
    const std::size_t k = edges.per_row;
    args.pool.parallel_for(args.rows(out), 4, [&](std::size_t begin, std::size_t end) {
      PairRow<T, Width> node(constants_, edges.per_row);
      for (std::size_t row = begin; row < end; ++row)
        node.evaluate(features.as<T>(), edges.as<std::uint32_t>() + row * k, args.in[2].as<T>(), row,
                      out.as<T>() + row * out.stride());
    });
  }

  const PairConstants<T> constants_;
};

}  // namespace

template <>
KernelPtr<float> make_kernel(const ops::PairAttention& op) {
  return std::make_unique<PairAttentionKernel<float>>(op);
}
template <>
KernelPtr<double> make_kernel(const ops::PairAttention& op) {
  return std::make_unique<PairAttentionKernel<double>>(op);
}

}  // namespace bitr::cpu
