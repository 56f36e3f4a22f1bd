#include <cmath>

#include "cpu/cloud_chunks.hpp"

namespace bitr::cpu {
namespace {

// One chunk's softmax relative to its own largest logit.
struct Partial {
  Eigen::ArrayXd largest, total;
  std::vector<RowMatrix<double>> sums;
};

template <class T>
class SoftmaxSumKernel : public Kernel<T> {
 public:
  explicit SoftmaxSumKernel(const ops::SoftmaxSum& op) : op_(op) {}

  void run(const Arguments& args) const override {
    const auto chunks = cloud_chunks(args.layout);
    std::vector<Partial> parts(chunks.size());
    args.pool.parallel_for(chunks.size(), 1, [&](std::size_t first, std::size_t last) {
      for (std::size_t i = first; i < last; ++i) parts[i] = reduce(args, chunks[i]);
    });
    for (std::uint32_t cloud = 0, i = 0; cloud < args.layout.clouds(); ++cloud) {
      const std::uint32_t begin = i;
      Eigen::ArrayXd largest = parts[begin].largest;
      for (; i < chunks.size() && chunks[i].cloud == cloud; ++i) largest = largest.max(parts[i].largest);
      Partial sum = scaled(parts[begin], largest);
      for (std::uint32_t j = begin + 1; j < i; ++j) {
        const Partial part = scaled(parts[j], largest);
        sum.total += part.total;
        for (std::size_t v = 0; v < sum.sums.size(); ++v) sum.sums[v] += part.sums[v];
      }
      for (std::size_t v = 0; v < sum.sums.size(); ++v)
        Eigen::Map<RowMatrix<T>>(args.out[v].as<T>() + std::size_t{cloud} * op_.channels * args.out[v].width,
                                 op_.channels, args.out[v].width) =
            (sum.sums[v].array().colwise() / sum.total).matrix().template cast<T>();
    }
  }

 private:
  using Row = Eigen::Array<T, Eigen::Dynamic, 1>;

  Partial reduce(const Arguments& args, const CloudChunk& chunk) const {
    const Slot& logits = args.in[0];
    const auto at = [](const Slot& slot, std::size_t row, int skip, int count) {
      return Eigen::Map<const Row>(slot.as<T>() + row * slot.stride() + skip, count);
    };
    Row largest = at(logits, chunk.begin, 0, op_.channels);
    for (std::size_t row = chunk.begin + 1; row < chunk.end; ++row)
      largest = largest.max(at(logits, row, 0, op_.channels));

    Partial part{largest.template cast<double>(), Eigen::ArrayXd::Zero(op_.channels), {}};
    for (std::size_t v = 0; v < op_.skip.size(); ++v)
      part.sums.push_back(RowMatrix<double>::Zero(op_.channels, args.out[v].width));
    Row e(op_.channels);
    Eigen::ArrayXd weight(op_.channels);
    for (std::size_t row = chunk.begin; row < chunk.end; ++row) {
      e = (at(logits, row, 0, op_.channels) - largest).exp();
      weight = e.template cast<double>();
      part.total += weight;
      for (std::size_t v = 0; v < part.sums.size(); ++v) {
        const auto value = at(args.in[v + 1], row, op_.skip[v], args.out[v].width);
        for (int w = 0; w < args.out[v].width; ++w)
          part.sums[v].col(w).array() += weight * static_cast<double>(value[w]);
      }
    }
    return part;
  }

  static Partial scaled(const Partial& part, const Eigen::ArrayXd& largest) {
    const Eigen::ArrayXd factor = (part.largest - largest).exp();
    Partial result{largest, part.total * factor, part.sums};
    for (auto& sum : result.sums) sum.array().colwise() *= factor;
    return result;
  }

  const ops::SoftmaxSum op_;
};

}  // namespace

template <>
KernelPtr<float> make_kernel(const ops::SoftmaxSum& op) {
  return std::make_unique<SoftmaxSumKernel<float>>(op);
}
template <>
KernelPtr<double> make_kernel(const ops::SoftmaxSum& op) {
  return std::make_unique<SoftmaxSumKernel<double>>(op);
}

}  // namespace bitr::cpu
