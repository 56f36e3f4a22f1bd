#include "core/failure.hpp"
#include "vk/kernel.hpp"

namespace bitr::vk {

KernelPtr make_kernel(const Site&, const ops::PointAttention&) {
  throw Failure(ErrorCode::unsupported, "point_attention has no Vulkan kernel yet");
}

}  // namespace bitr::vk
