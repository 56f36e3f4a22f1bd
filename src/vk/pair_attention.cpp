#include "core/failure.hpp"
#include "vk/kernel.hpp"

namespace bitr::vk {

KernelPtr make_kernel(const Site&, const ops::PairAttention&) {
  throw Failure(ErrorCode::unsupported, "pair_attention has no Vulkan kernel yet");
}

}  // namespace bitr::vk
