#include "cpu/kernel.hpp"
namespace bitr::cpu {
template <class T> KernelPtr<T> make_kernel(const ops::PairAttention&) { return nullptr; }
template KernelPtr<float> make_kernel(const ops::PairAttention&);
template KernelPtr<double> make_kernel(const ops::PairAttention&);
}
