#include <algorithm>

#include "cpu/kernel.hpp"

namespace bitr::cpu {
namespace {

constexpr int most_neighbors = 64;

// In an order that depends on the width alone, not on where the rows lie in memory.
template <class T>
T dot(const T* a, const T* b, int width) {
  Lanes<T> sums = Lanes<T>::Zero();
  int i = 0;
  for (; i + lane_count <= width; i += lane_count)
    sums += Eigen::Map<const Lanes<T>>(a + i) * Eigen::Map<const Lanes<T>>(b + i);
  T sum = sums.sum();
  for (; i < width; ++i) sum += a[i] * b[i];
  return sum;
}

template <class T>
class NeighbourAttentionKernel : public Kernel<T> {
 public:
  explicit NeighbourAttentionKernel(const ops::NeighbourAttention& op) : scale_(static_cast<T>(op.scale)) {}

  void run(const Arguments& args) const override {
    const Slot &queries = args.in[0], &keys = args.in[1], &values = args.in[2], &out = args.out[0];
    const int heads = queries.per_row, k = args.in[3].per_row;
    args.pool.parallel_for(args.rows(out), 64, [&](std::size_t begin, std::size_t end) {
      for (std::size_t row = begin; row < end; ++row) {
        const std::uint32_t* index = args.in[3].as<std::uint32_t>() + row * k;
        for (int h = 0; h < heads; ++h) {
          const auto entry = [&](const Slot& slot, std::size_t r) {
            return slot.as<T>() + r * slot.stride() + h * slot.width;
          };
          Weights weights(k);
          for (int j = 0; j < k; ++j)
            weights[j] = scale_ * dot<T>(entry(queries, row), entry(keys, index[j]), queries.width);
          weights = (weights - weights.maxCoeff()).exp();
          weights /= weights.sum();
          aggregate(weights, values.width, entry(out, row),
                    [&](int j) -> const T* { return entry(values, index[j]); });
        }
      }
    });
  }

 private:
  using Weights = Eigen::Array<T, Eigen::Dynamic, 1, 0, most_neighbors, 1>;

  template <class Value>
  static void aggregate(const Weights& weights, int width, T* out, Value value) {
    int i = 0;
    for (; i + lane_count <= width; i += lane_count) {
      Lanes<T> sum = Lanes<T>::Zero();
      for (int j = 0; j < weights.size(); ++j) sum += weights[j] * Eigen::Map<const Lanes<T>>(value(j) + i);
      Eigen::Map<Lanes<T>>(out + i) = sum;
    }
    for (; i < width; ++i) {
      T sum = 0;
      for (int j = 0; j < weights.size(); ++j) sum += weights[j] * value(j)[i];
      out[i] = sum;
    }
  }

  const T scale_;
};

}  // namespace

template <>
KernelPtr<float> make_kernel(const ops::NeighbourAttention& op) {
  return std::make_unique<NeighbourAttentionKernel<float>>(op);
}
template <>
KernelPtr<double> make_kernel(const ops::NeighbourAttention& op) {
  return std::make_unique<NeighbourAttentionKernel<double>>(op);
}

}  // namespace bitr::cpu
