#include "cpu/projected_relu.hpp"

#include <algorithm>
#include <cmath>

namespace bitr::cpu {

template <class T>
void projected_relu(const RowMatrix<T>& plane, bool square, int dim, T* x) {
  constexpr int most = 256 * 9;
  T mixed[most];
  const int channels = static_cast<int>(plane.rows());
  for (int c = 0; c < channels; ++c)
    for (int m = 0; m < dim; ++m) {
      T sum = 0;
      for (int j = 0; j < channels; ++j) sum += plane(c, j) * x[j * dim + m];
      mixed[c * dim + m] = sum;
    }
  for (int c = 0; c < channels; ++c) {
    T along = 0, length2 = 0;
    for (int m = 0; m < dim; ++m) {
      along += x[c * dim + m] * mixed[c * dim + m];
      length2 += mixed[c * dim + m] * mixed[c * dim + m];
    }
    if (along >= 0) continue;
    const T norm = std::max(std::sqrt(length2), static_cast<T>(ops::plane_norm_floor));
    const T factor = static_cast<T>(1 - ops::leaky_slope) * along / (square ? norm * norm : norm);
    for (int m = 0; m < dim; ++m) x[c * dim + m] -= factor * mixed[c * dim + m];
  }
}

template <class T>
RowRelu<T>::RowRelu(const irreps::Fiber& fiber, const ops::DegreeMatrices& planes, bool square)
    : scalars_(fiber.channels({0, 0})), square_(square) {
  for (const auto& [d, plane] : planes)
    parts_.push_back({d, fiber.offset(d), d.dim(), plane.template cast<T>()});
}

template <class T>
void RowRelu<T>::apply(T* row) const {
  for (int c = 0; c < scalars_; ++c) row[c] = leaky(row[c]);
  for (const Part& part : parts_) projected_relu(part.plane, square_, part.dim, row + part.offset);
}

template void projected_relu(const RowMatrix<float>&, bool, int, float*);
template void projected_relu(const RowMatrix<double>&, bool, int, double*);
template class RowRelu<float>;
template class RowRelu<double>;

namespace {

template <class T>
class ProjectedReluKernel : public Kernel<T> {
 public:
  explicit ProjectedReluKernel(const ops::ProjectedRelu& op) : relu_(op.fiber, op.planes, op.square) {}

  void run(const Arguments& args) const override {
    const std::size_t width = args.out[0].stride();
    const T* in = args.in[0].as<T>();
    T* out = args.out[0].as<T>();
    args.pool.parallel_for(args.rows(args.out[0]), 512, [&](std::size_t begin, std::size_t end) {
      for (std::size_t row = begin; row < end; ++row) {
        std::copy_n(in + row * width, width, out + row * width);
        relu_.apply(out + row * width);
      }
    });
  }

 private:
  RowRelu<T> relu_;
};

}  // namespace

template <>
KernelPtr<float> make_kernel(const ops::ProjectedRelu& op) {
  return std::make_unique<ProjectedReluKernel<float>>(op);
}
template <>
KernelPtr<double> make_kernel(const ops::ProjectedRelu& op) {
  return std::make_unique<ProjectedReluKernel<double>>(op);
}

}  // namespace bitr::cpu
