#include "cpu/kernel.hpp"
namespace bitr::cpu {
template <class T> KernelPtr<T> make_kernel(const ops::MeanDirection&) { return nullptr; }
template KernelPtr<float> make_kernel(const ops::MeanDirection&);
template KernelPtr<double> make_kernel(const ops::MeanDirection&);
}
