#include "core/failure.hpp"
#include "vk/kernel.hpp"

namespace bitr::vk {

KernelPtr make_kernel(const Site&, const ops::SoftmaxSum&) {
  throw Failure(ErrorCode::unsupported, "softmax_sum has no Vulkan kernel yet");
}

}  // namespace bitr::vk
