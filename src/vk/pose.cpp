#include "core/failure.hpp"
#include "vk/kernel.hpp"

namespace bitr::vk {

KernelPtr make_kernel(const Site&, const ops::ProjectPose&) {
  throw Failure(ErrorCode::unsupported, "pose has no Vulkan kernel yet");
}

}  // namespace bitr::vk
