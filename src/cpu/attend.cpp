#include <algorithm>
#include <cmath>

#include "cpu/attend.hpp"
#include "cpu/kernel.hpp"

namespace bitr::cpu {
namespace {

template <class T>
class AttendKernel : public Kernel<T> {
 public:
  explicit AttendKernel(const ops::Attend& op)
      : op_(op),
        values_(head_runs(op.value_fiber, op.values_fiber, op.heads, false)),
        keys_(head_runs(op.key_fiber, op.keys_fiber, op.heads, true)),
        scale_(static_cast<T>(1 / std::sqrt(op.key_fiber.component_count()))) {}

  void run(const Arguments& args) const override {
    const Slot &values = args.in[0], &keys = args.in[1], &out = args.out[2];
    const int k = values.per_row, heads = op_.heads;
    args.pool.parallel_for(args.rows(out), 64, [&](std::size_t begin, std::size_t end) {
      for (std::size_t row = begin; row < end; ++row) {
        T* logits = args.out[0].as<T>() + row * k * heads;
        T* weights = args.out[1].as<T>() + row * k * heads;
        T* sum = out.as<T>() + row * out.stride();
        std::fill_n(logits, k * heads, T{0});
        if (args.in.size() > 2) {
          const T* query = args.in[2].as<T>() + row * args.in[2].stride();
          for (int j = 0; j < k; ++j)
            score(keys.as<T>() + (row * k + j) * keys.width, query, logits + j * heads);
        }
        softmax(logits, weights, k);
        std::fill_n(sum, out.stride(), T{0});
        for (int j = 0; j < k; ++j)
          for (const HeadRun& run : values_)
            for (int i = 0; i < run.length; ++i)
              sum[run.to + i] +=
                  weights[j * heads + run.head] * values.as<T>()[(row * k + j) * values.width + run.from + i];
      }
    });
  }

 private:
  void score(const T* key, const T* query, T* logits) const {
    for (const HeadRun& run : keys_)
      for (int i = 0; i < run.length; ++i) logits[run.head] += key[run.from + i] * query[run.to + i] * scale_;
  }

  void softmax(const T* logits, T* weights, int k) const {
    const int heads = op_.heads;
    for (int h = 0; h < heads; ++h) {
      T peak = logits[h], total = 0;
      for (int j = 1; j < k; ++j) peak = std::max(peak, logits[j * heads + h]);
      for (int j = 0; j < k; ++j) total += weights[j * heads + h] = std::exp(logits[j * heads + h] - peak);
      for (int j = 0; j < k; ++j) weights[j * heads + h] /= total;
    }
  }

  const ops::Attend op_;
  const std::vector<HeadRun> values_, keys_;
  const T scale_;
};

}  // namespace

template <>
KernelPtr<float> make_kernel(const ops::Attend& op) {
  return std::make_unique<AttendKernel<float>>(op);
}
template <>
KernelPtr<double> make_kernel(const ops::Attend& op) {
  return std::make_unique<AttendKernel<double>>(op);
}

}  // namespace bitr::cpu
