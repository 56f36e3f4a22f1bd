#include <algorithm>
#include <array>

#include "cpu/kernel.hpp"
#include "irreps/coupling.hpp"

namespace bitr::cpu {
namespace {

constexpr int most_components = 25;  // as many as degree (2, 2) has

template <class T>
class CgProductKernel : public Kernel<T> {
 public:
  explicit CgProductKernel(const ops::CgProduct& op) : op_(op) {
    for (const auto& [component, i, j, coefficient] : irreps::coupling_terms(op.a, op.b, op.out))
      terms_.push_back({component, i, j, static_cast<T>(coefficient)});
  }

  // Eight channels, of one edge or of several, at once.
  void run(const Arguments& args) const override {
    const Slot &a = args.in[0], &b = args.in[1], &out = args.out[0];
    const std::uint32_t* index = args.in.size() > 2 ? args.in[2].as<std::uint32_t>() : nullptr;
    const auto channels = static_cast<std::size_t>(op_.channels);
    const std::size_t items = args.rows(out) * out.per_row * channels;
    args.pool.parallel_for(items, 128 * lane_count, [&](std::size_t begin, std::size_t end) {
      std::array<Lanes<T>, most_components> left, right, product;
      for (std::size_t first = begin; first < end; first += lane_count) {
        const auto count = static_cast<int>(std::min<std::size_t>(lane_count, end - first));
        for (int lane = 0; lane < lane_count; ++lane) {
          const std::size_t item = first + std::min(lane, count - 1);
          const std::size_t edge = item / channels, channel = item % channels;
          load(a.as<T>() + ((index ? index[edge] : edge) * channels + channel) * op_.a.dim(), op_.a.dim(),
               lane, left);
          load(b.as<T>() + (op_.shared ? edge : item) * op_.b.dim(), op_.b.dim(), lane, right);
        }
        for (int m = 0; m < op_.out.dim(); ++m) product[m].setZero();
        for (const Term& term : terms_)
          product[term.component] += term.coefficient * left[term.i] * right[term.j];
        for (int lane = 0; lane < count; ++lane)
          for (int m = 0; m < op_.out.dim(); ++m)
            out.as<T>()[(first + lane) * op_.out.dim() + m] = product[m][lane];
      }
    });
  }

 private:
  struct Term {
    int component, i, j;
    T coefficient;
  };
  static void load(const T* from, int count, int lane, std::array<Lanes<T>, most_components>& to) {
    for (int i = 0; i < count; ++i) to[i][lane] = from[i];
  }

  const ops::CgProduct op_;
  std::vector<Term> terms_;
};

}  // namespace

template <>
KernelPtr<float> make_kernel(const ops::CgProduct& op) {
  return std::make_unique<CgProductKernel<float>>(op);
}
template <>
KernelPtr<double> make_kernel(const ops::CgProduct& op) {
  return std::make_unique<CgProductKernel<double>>(op);
}

}  // namespace bitr::cpu
