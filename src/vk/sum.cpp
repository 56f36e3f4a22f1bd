#include "sum.spv.hpp"

#include <algorithm>

#include "vk/kernel.hpp"

namespace bitr::vk {
namespace {

constexpr std::size_t most_terms = 6;

constexpr VkDeviceSize item_bytes = 4 * sizeof(float);

class SumKernel : public Kernel {
 public:
  explicit SumKernel(const KernelContext& site) : capabilities_(site.context.capabilities()) {
    for (std::size_t first = 0; first < site.in.size(); first += most_terms) {
      const std::size_t count = std::min(most_terms, site.in.size() - first);
      pipelines_.push_back(site.context.pipeline(
          shaders::sum, std::array{tile_rows, static_cast<std::uint32_t>(count), std::uint32_t{first > 0}}));
    }
  }

  void record(const Arguments& args) const override {
    const VkDeviceSize bytes = args.out[0].range.size;
    // A multiple of 64 items keeps bindings aligned.
    const VkDeviceSize most = std::min<VkDeviceSize>(std::uint64_t{capabilities_.groups} * tile_rows,
                                                     capabilities_.storage_range / item_bytes) /
                              64 * 64 * item_bytes;
    for (std::size_t i = 0; i < pipelines_.size(); ++i)
      for (VkDeviceSize at = 0; at < bytes; at += most) {
        const VkDeviceSize part = std::min(most, bytes - at);
        const auto items = static_cast<std::uint32_t>(part / item_bytes);
        std::vector<Range> ranges;
        for (std::size_t t = 0; t < most_terms; ++t)
          ranges.push_back(args.in[std::min(i * most_terms + t, args.in.size() - 1)].range.sub(at, part));
        ranges.push_back(args.out[0].range.sub(at, part));
        args.schedule.dispatch(pipelines_[i], ranges, ItemParameters{items},
                               {(items + tile_rows - 1) / tile_rows, 1, 1}, 4.0 * items);
      }
  }

 private:
  const Capabilities& capabilities_;
  std::vector<PipelineOf<ItemParameters>> pipelines_;
};

}  // namespace

template <>
KernelPtr make_kernel(const KernelContext& site, const ops::Sum&) {
  return std::make_unique<SumKernel>(site);
}

}  // namespace bitr::vk
