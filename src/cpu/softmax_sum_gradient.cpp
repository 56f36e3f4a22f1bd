#include <cmath>

#include "cpu/cloud_chunks.hpp"

namespace bitr::cpu {
namespace {

// The softmax's denominators over one chunk or one cloud, per channel.
struct Normalizer {
  Eigen::ArrayXd largest, total;

  void add(const Normalizer& other) {
    const Eigen::ArrayXd most = largest.max(other.largest);
    total = total * (largest - most).exp() + other.total * (other.largest - most).exp();
    largest = most;
  }
};

template <class T>
class SoftmaxSumGradient : public Kernel<T> {
 public:
  explicit SoftmaxSumGradient(const ops::Gradient<ops::SoftmaxSum>& op)
      : op_(op), channels_(op.op.channels), values_(static_cast<int>(op.op.skip.size())) {}

  void run(const Arguments& args) const override {
    const GradientSlots<ops::SoftmaxSum> slots{op_, args};
    const auto chunks = cloud_chunks(args.layout);
    std::vector<Normalizer> parts(chunks.size());
    args.pool.parallel_for(chunks.size(), 1, [&](std::size_t first, std::size_t last) {
      for (std::size_t i = first; i < last; ++i) parts[i] = normalizer(slots.in(0), chunks[i]);
    });
    std::vector<Normalizer> whole(args.layout.clouds());
    for (std::size_t i = 0; i < chunks.size(); ++i) {
      Normalizer& cloud = whole[chunks[i].cloud];
      if (cloud.total.size() == 0)
        cloud = parts[i];
      else
        cloud.add(parts[i]);
    }
    args.pool.parallel_for(chunks.size(), 1, [&](std::size_t first, std::size_t last) {
      for (std::size_t i = first; i < last; ++i) differentiate(slots, chunks[i], whole[chunks[i].cloud]);
    });
  }

 private:
  using Row = Eigen::Array<T, Eigen::Dynamic, 1>;
  using ColumnMatrix = Eigen::Array<T, Eigen::Dynamic, Eigen::Dynamic>;
  using Slots = GradientSlots<ops::SoftmaxSum>;

  Eigen::Map<const Row> logits_at(const Slot& logits, std::size_t row) const {
    return Eigen::Map<const Row>(logits.as<T>() + row * logits.stride(), channels_);
  }

  Normalizer normalizer(const Slot& logits, const CloudChunk& chunk) const {
    Row largest = logits_at(logits, chunk.begin);
    for (std::size_t row = chunk.begin + 1; row < chunk.end; ++row)
      largest = largest.max(logits_at(logits, row));
    Normalizer part{largest.template cast<double>(), Eigen::ArrayXd::Zero(channels_)};
    for (std::size_t row = chunk.begin; row < chunk.end; ++row)
      part.total += (logits_at(logits, row) - largest).exp().template cast<double>();
    return part;
  }

  void differentiate(const Slots& slots, const CloudChunk& chunk, const Normalizer& norm) const {
    // Gradients of the sums, channels × columns, and ⟨gradient, sum⟩.
    std::vector<ColumnMatrix> grad_output(values_);
    Row mean = Row::Zero(channels_);
    for (int v = 0; v < values_; ++v) {
      const Slot* slot = slots.grad_output(v);
      if (slot == nullptr) continue;
      const auto of_cloud = [&](const Slot& from) {
        return Eigen::Map<const Eigen::Array<T, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(
            from.as<T>() + std::size_t{chunk.cloud} * channels_ * from.width, channels_, from.width);
      };
      grad_output[v] = of_cloud(*slot);
      mean += (grad_output[v] * of_cloud(slots.out(v))).rowwise().sum();
    }
    const Row largest = norm.largest.template cast<T>(), scale = (1 / norm.total).template cast<T>();
    Row weight(channels_), along(channels_);
    for (std::size_t row = chunk.begin; row < chunk.end; ++row) {
      weight = (logits_at(slots.in(0), row) - largest).exp() * scale;
      along = -mean;
      for (int v = 0; v < values_; ++v) {
        const Slot& from = slots.in(v + 1);
        const T* value = from.as<T>() + row * from.stride() + op_.op.skip[v];
        for (Eigen::Index c = 0; c < grad_output[v].cols(); ++c) along += grad_output[v].col(c) * value[c];
        if (const Slot* to = slots.grad_input(v + 1))
          write_value(grad_output[v], weight, op_.op.skip[v], *to, row);
      }
      if (const Slot* to = slots.grad_input(0)) {
        T* at = to->as<T>() + row * to->stride();
        Eigen::Map<Row>(at, channels_) = weight * along;
        std::fill(at + channels_, at + to->stride(), T{0});
      }
    }
  }

  static void write_value(const ColumnMatrix& grad_output, const Row& weight, int skip, const Slot& to,
                          std::size_t row) {
    T* at = to.as<T>() + row * to.stride();
    std::fill(at, at + to.stride(), T{0});
    for (Eigen::Index c = 0; c < grad_output.cols(); ++c) at[skip + c] = (weight * grad_output.col(c)).sum();
  }

  const ops::Gradient<ops::SoftmaxSum> op_;
  const int channels_, values_;
};

}  // namespace

template <>
KernelPtr<float> make_kernel(const ops::Gradient<ops::SoftmaxSum>& op) {
  return std::make_unique<SoftmaxSumGradient<float>>(op);
}
template <>
KernelPtr<double> make_kernel(const ops::Gradient<ops::SoftmaxSum>& op) {
  return std::make_unique<SoftmaxSumGradient<double>>(op);
}

}  // namespace bitr::cpu
