#include <cmath>
#include <limits>

#include "cpu/cloud_chunks.hpp"

namespace bitr::cpu {
namespace {

template <class T>
class CloudSoftmaxKernel : public Kernel<T> {
 public:
  explicit CloudSoftmaxKernel(const ops::CloudSoftmax& op) : channels_(op.channels) {}

  void run(const Arguments& args) const override {
    const auto chunks = cloud_chunks(args.layout);
    const Slot& in = args.in[0];
    T* out = args.out[0].as<T>();
    Eigen::ArrayXXd peaks(channels_, chunks.size()), sums(channels_, chunks.size());
    args.pool.parallel_for(chunks.size(), 1, [&](std::size_t first, std::size_t last) {
      for (std::size_t i = first; i < last; ++i) {
        peaks.col(i).setConstant(-std::numeric_limits<double>::infinity());
        for (std::size_t row = chunks[i].begin; row < chunks[i].end; ++row)
          peaks.col(i) = peaks.col(i).max(values(in, row).template cast<double>());
      }
    });
    const Eigen::ArrayXXd peak = combine(args, chunks, peaks, true);
    args.pool.parallel_for(chunks.size(), 1, [&](std::size_t first, std::size_t last) {
      for (std::size_t i = first; i < last; ++i) {
        sums.col(i).setZero();
        const Eigen::Array<T, Eigen::Dynamic, 1> shift = peak.col(chunks[i].cloud).template cast<T>();
        for (std::size_t row = chunks[i].begin; row < chunks[i].end; ++row) {
          Eigen::Map<Eigen::Array<T, Eigen::Dynamic, 1>> e(out + row * channels_, channels_);
          e = (values(in, row) - shift).exp();
          sums.col(i) += e.template cast<double>();
        }
      }
    });
    const Eigen::ArrayXXd total = combine(args, chunks, sums, false);
    args.pool.parallel_for(chunks.size(), 1, [&](std::size_t first, std::size_t last) {
      for (std::size_t i = first; i < last; ++i) {
        const Eigen::Array<T, Eigen::Dynamic, 1> scale =
            total.col(chunks[i].cloud).inverse().template cast<T>();
        for (std::size_t row = chunks[i].begin; row < chunks[i].end; ++row)
          Eigen::Map<Eigen::Array<T, Eigen::Dynamic, 1>>(out + row * channels_, channels_) *= scale;
      }
    });
  }

 private:
  auto values(const Slot& in, std::size_t row) const {
    return Eigen::Map<const Eigen::Array<T, Eigen::Dynamic, 1>>(in.as<T>() + row * in.stride(), channels_);
  }

  // channels × clouds, from channels × chunks.
  Eigen::ArrayXXd combine(const Arguments& args, const std::vector<CloudChunk>& chunks,
                          const Eigen::ArrayXXd& parts, bool largest) const {
    Eigen::ArrayXXd all = Eigen::ArrayXXd::Constant(channels_, args.layout.clouds(),
                                                    largest ? -std::numeric_limits<double>::infinity() : 0.0);
    for (std::size_t i = 0; i < chunks.size(); ++i) {
      auto column = all.col(chunks[i].cloud);
      if (largest)
        column = column.max(parts.col(i));
      else
        column += parts.col(i);
    }
    return all;
  }

  const int channels_;
};

}  // namespace

template <>
KernelPtr<float> make_kernel(const ops::CloudSoftmax& op) {
  return std::make_unique<CloudSoftmaxKernel<float>>(op);
}
template <>
KernelPtr<double> make_kernel(const ops::CloudSoftmax& op) {
  return std::make_unique<CloudSoftmaxKernel<double>>(op);
}

}  // namespace bitr::cpu
