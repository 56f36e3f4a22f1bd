#include "cpu/cloud_chunks.hpp"

namespace bitr::cpu {
namespace {

template <class T>
class CloudSumKernel : public Kernel<T> {
 public:
  explicit CloudSumKernel(const ops::CloudSum& op) : op_(op) {}

  void run(const Arguments& args) const override {
    const auto chunks = cloud_chunks(args.layout);
    const Slot &weights = args.in[0], &values = args.in[1], &out = args.out[0];
    std::vector<RowMatrix<double>> parts(chunks.size());
    args.pool.parallel_for(chunks.size(), 1, [&](std::size_t first, std::size_t last) {
      for (std::size_t i = first; i < last; ++i) {
        parts[i].setZero(op_.channels, out.width);
        for (std::size_t row = chunks[i].begin; row < chunks[i].end; ++row)
          parts[i].noalias() +=
              vector(weights, row, 0, op_.channels) * vector(values, row, op_.skip, out.width).transpose();
      }
    });
    std::vector<RowMatrix<double>> sums(args.layout.clouds(),
                                        RowMatrix<double>::Zero(op_.channels, out.width));
    for (std::size_t i = 0; i < chunks.size(); ++i) sums[chunks[i].cloud] += parts[i];
    for (std::size_t cloud = 0; cloud < sums.size(); ++cloud)
      Eigen::Map<RowMatrix<T>>(out.as<T>() + cloud * op_.channels * out.width, op_.channels, out.width) =
          sums[cloud].cast<T>();
  }

 private:
  static Eigen::VectorXd vector(const Slot& slot, std::size_t row, int skip, int count) {
    return Eigen::Map<const Eigen::Matrix<T, Eigen::Dynamic, 1>>(slot.as<T>() + row * slot.stride() + skip,
                                                                 count)
        .template cast<double>();
  }

  const ops::CloudSum op_;
};

}  // namespace

template <>
KernelPtr<float> make_kernel(const ops::CloudSum& op) {
  return std::make_unique<CloudSumKernel<float>>(op);
}
template <>
KernelPtr<double> make_kernel(const ops::CloudSum& op) {
  return std::make_unique<CloudSumKernel<double>>(op);
}

}  // namespace bitr::cpu
