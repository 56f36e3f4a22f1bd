#include "core/failure.hpp"
#include "vk/kernel.hpp"

namespace bitr::vk {

KernelPtr make_kernel(const Site&, const ops::MeanDirection&) {
  throw Failure(ErrorCode::unsupported, "mean_direction has no Vulkan kernel yet");
}

}  // namespace bitr::vk
