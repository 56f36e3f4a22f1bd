#include "core/failure.hpp"
#include "vk/kernel.hpp"

namespace bitr::vk {

KernelPtr make_kernel(const Site&, const ops::InputFeatures&) {
  throw Failure(ErrorCode::unsupported, "input_features has no Vulkan kernel yet");
}

}  // namespace bitr::vk
