// Operations whose kernels are still to come.
#include "core/failure.hpp"
#include "cpu/kernel.hpp"

namespace bitr::cpu {

#define BITR_PENDING(Operation)                                         \
  template <class T>                                                    \
  KernelPtr<T> make_kernel(const Operation&) {                          \
    throw Failure(ErrorCode::unsupported, "no kernel for " #Operation); \
  }                                                                     \
  template KernelPtr<float> make_kernel(const Operation&);              \
  template KernelPtr<double> make_kernel(const Operation&);

BITR_PENDING(ops::Gradient<ops::EdgeGeometry>)
BITR_PENDING(ops::Gradient<ops::Convolve>)
BITR_PENDING(ops::Gradient<ops::Linear>)
BITR_PENDING(ops::Gradient<ops::Attend>)
BITR_PENDING(ops::Gradient<ops::ProjectedRelu>)
BITR_PENDING(ops::Gradient<ops::CloudSoftmax>)
BITR_PENDING(ops::Gradient<ops::CloudSum>)
BITR_PENDING(ops::Gradient<ops::ExtendFeatures>)

}  // namespace bitr::cpu
