#include <algorithm>

#include "cpu/cloud_chunks.hpp"

namespace bitr::cpu {
namespace {

template <class T>
class ExtendFeaturesGradient : public Kernel<T> {
 public:
  explicit ExtendFeaturesGradient(const ops::Gradient<ops::ExtendFeatures>& op)
      : op_(op), scalars_(op.op.fiber.channels({0, 0})), vectors_(3 * op.op.fiber.channels({1, 0})) {}

  void run(const Arguments& args) const override {
    const GradientSlots<ops::ExtendFeatures> slots{op_, args};
    const auto chunks = cloud_chunks(args.layout);
    const Eigen::ArrayXXd sums = cloud_sums(slots, chunks);
    if (const Slot* to = slots.grad_input(0)) own(args, chunks, slots.grad_output(0), *to);
    const int globals = op_.op.global_channels, means_begin = scalars_ + 2 * globals;
    for (std::uint32_t cloud = 0; cloud < args.layout.clouds(); ++cloud) {
      const Eigen::ArrayXd self = sums.col(cloud), other = sums.col(args.layout.other(cloud));
      if (const Slot* to = slots.grad_input(1)) {
        Eigen::ArrayXd means(scalars_ + vectors_);
        means << self.segment(means_begin, scalars_) + other.segment(means_begin + scalars_, scalars_),
            self.tail(vectors_);
        row(*to, cloud) = means.template cast<T>();
      }
      if (const Slot* to = slots.grad_input(2))
        row(*to, cloud) =
            (self.segment(scalars_, globals) + other.segment(scalars_ + globals, globals)).template cast<T>();
    }
  }

 private:
  static auto row(const Slot& slot, std::size_t i) {
    return Eigen::Map<Eigen::Array<T, Eigen::Dynamic, 1>>(slot.as<T>() + i * slot.stride(), slot.width);
  }

  // The extended features' gradient summed over each cloud, a column per cloud.
  static Eigen::ArrayXXd cloud_sums(const GradientSlots<ops::ExtendFeatures>& slots,
                                    const std::vector<CloudChunk>& chunks) {
    const int width = slots.out(0).width;
    Eigen::ArrayXXd parts = Eigen::ArrayXXd::Zero(width, chunks.size());
    Eigen::ArrayXXd sums = Eigen::ArrayXXd::Zero(width, slots.args.layout.clouds());
    const Slot* grad_output = slots.grad_output(0);
    if (!grad_output) return sums;
    slots.args.pool.parallel_for(chunks.size(), 1, [&](std::size_t first, std::size_t last) {
      for (std::size_t i = first; i < last; ++i)
        for (std::size_t point = chunks[i].begin; point < chunks[i].end; ++point)
          parts.col(i) += row(*grad_output, point).template cast<double>();
    });
    for (std::size_t i = 0; i < chunks.size(); ++i) sums.col(chunks[i].cloud) += parts.col(i);
    return sums;
  }

  void own(const Arguments& args, const std::vector<CloudChunk>& chunks, const Slot* grad_output,
           const Slot& grad_input) const {
    const int vectors_begin = 3 * scalars_ + 2 * op_.op.global_channels;
    args.pool.parallel_for(chunks.size(), 1, [&](std::size_t first, std::size_t last) {
      for (std::size_t point = chunks[first].begin; point < chunks[last - 1].end; ++point) {
        auto to = row(grad_input, point);
        if (grad_output)
          to << row(*grad_output, point).head(scalars_),
              row(*grad_output, point).segment(vectors_begin, vectors_);
        else
          to.setZero();
      }
    });
  }

  const ops::Gradient<ops::ExtendFeatures> op_;
  const int scalars_, vectors_;
};

}  // namespace

template <>
KernelPtr<float> make_kernel(const ops::Gradient<ops::ExtendFeatures>& op) {
  return std::make_unique<ExtendFeaturesGradient<float>>(op);
}
template <>
KernelPtr<double> make_kernel(const ops::Gradient<ops::ExtendFeatures>& op) {
  return std::make_unique<ExtendFeaturesGradient<double>>(op);
}

}  // namespace bitr::cpu
