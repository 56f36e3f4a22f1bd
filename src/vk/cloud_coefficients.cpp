#include "core/failure.hpp"
#include "vk/kernel.hpp"

namespace bitr::vk {

KernelPtr make_kernel(const Site&, const ops::CloudCoefficients&) {
  throw Failure(ErrorCode::unsupported, "cloud_coefficients has no Vulkan kernel yet");
}

}  // namespace bitr::vk
