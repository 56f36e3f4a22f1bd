#include "cpu/attend.hpp"

#include <algorithm>
#include <cmath>

#include "cpu/kernel.hpp"

namespace bitr::cpu {
namespace {

enum : int { values_input, keys_input, query_input };
enum : int { logits_output, weights_output, sum_output };

template <class T>
class AttendGradient : public Kernel<T> {
 public:
  explicit AttendGradient(const ops::Gradient<ops::Attend>& op)
      : op_(op),
        values_(head_runs(op.op.value_fiber, op.op.values_fiber, op.op.heads, false)),
        keys_(head_runs(op.op.key_fiber, op.op.keys_fiber, op.op.heads, true)),
        scale_(static_cast<T>(1 / std::sqrt(op.op.key_fiber.component_count()))) {}

  void run(const Arguments& args) const override {
    const GradientSlots<ops::Attend> slots{op_, args};
    args.pool.parallel_for(args.rows(slots.out(sum_output)), 64, [&](std::size_t begin, std::size_t end) {
      std::vector<T> logits;
      for (std::size_t row = begin; row < end; ++row) {
        for (int i = 0; i < op_.inputs; ++i)
          if (slots.grad_input(i))
            std::fill_n(row_of(slots.grad_input(i), row), slots.grad_input(i)->stride(), T{0});
        logits_gradient(slots, row, logits);
        if (op_.inputs > query_input) score_gradient(slots, row, logits);
      }
    });
  }

 private:
  static T* row_of(const Slot* slot, std::size_t row) {
    return slot ? slot->as<T>() + row * slot->stride() : nullptr;
  }

  // Through the sum and the softmax, to the logits; the values' gradient on the way.
  void logits_gradient(const GradientSlots<ops::Attend>& slots, std::size_t row,
                       std::vector<T>& logits) const {
    const int heads = op_.op.heads, k = slots.out(weights_output).per_row;
    const T *weights = row_of(&slots.out(weights_output), row),
            *sum = row_of(slots.grad_output(sum_output), row);
    logits.assign(k * heads, T{0});
    if (const T* grad_output = row_of(slots.grad_output(weights_output), row))
      std::copy_n(grad_output, k * heads, logits.data());
    if (sum) {
      const T* values = row_of(&slots.in(values_input), row);
      T* grad_input = row_of(slots.grad_input(values_input), row);
      const int width = slots.in(values_input).width;
      for (int j = 0; j < k; ++j)
        for (const HeadRun& run : values_)
          for (int i = 0; i < run.length; ++i) {
            const int at = j * width + run.from + i;
            logits[j * heads + run.head] += values[at] * sum[run.to + i];
            if (grad_input) grad_input[at] = weights[j * heads + run.head] * sum[run.to + i];
          }
    }
    const T* grad_output = row_of(slots.grad_output(logits_output), row);
    for (int h = 0; h < heads; ++h) {
      T mean = 0;
      for (int j = 0; j < k; ++j) mean += weights[j * heads + h] * logits[j * heads + h];
      for (int j = 0; j < k; ++j) {
        T& logit = logits[j * heads + h];
        logit = weights[j * heads + h] * (logit - mean) + (grad_output ? grad_output[j * heads + h] : 0);
      }
    }
  }

  void score_gradient(const GradientSlots<ops::Attend>& slots, std::size_t row,
                      const std::vector<T>& logits) const {
    const int heads = op_.op.heads, k = slots.out(logits_output).per_row, width = slots.in(keys_input).width;
    const T *keys = row_of(&slots.in(keys_input), row), *query = row_of(&slots.in(query_input), row);
    T *to_keys = row_of(slots.grad_input(keys_input), row),
      *to_query = row_of(slots.grad_input(query_input), row);
    for (int j = 0; j < k; ++j)
      for (const HeadRun& run : keys_) {
        const T logit = logits[j * heads + run.head] * scale_;
        for (int i = 0; i < run.length; ++i) {
          if (to_keys) to_keys[j * width + run.from + i] = logit * query[run.to + i];
          if (to_query) to_query[run.to + i] += logit * keys[j * width + run.from + i];
        }
      }
  }

  const ops::Gradient<ops::Attend> op_;
  const std::vector<HeadRun> values_, keys_;
  const T scale_;
};

}  // namespace

template <>
KernelPtr<float> make_kernel(const ops::Gradient<ops::Attend>& op) {
  return std::make_unique<AttendGradient<float>>(op);
}
template <>
KernelPtr<double> make_kernel(const ops::Gradient<ops::Attend>& op) {
  return std::make_unique<AttendGradient<double>>(op);
}

}  // namespace bitr::cpu
