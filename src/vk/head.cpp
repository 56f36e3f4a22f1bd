#include "core/failure.hpp"
#include "vk/kernel.hpp"

namespace bitr::vk {

KernelPtr make_kernel(const Site&, const ops::Head&) {
  throw Failure(ErrorCode::unsupported, "head has no Vulkan kernel yet");
}

}  // namespace bitr::vk
