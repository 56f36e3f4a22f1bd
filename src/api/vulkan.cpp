#include <bitr/vulkan.hpp>
#include <numeric>

#include "api/internal.hpp"
#include "api/plan.hpp"
#include "core/guarded.hpp"
#include "vk/executor.hpp"

namespace bitr::vk {
namespace {

Result<void> check_sizes(std::span<const std::uint32_t> sizes, const char* side, std::size_t least) {
  for (std::size_t i = 0; i < sizes.size(); ++i)
    if (sizes[i] < least)
      return fail(ErrorCode::invalid_argument, std::string(side) + " cloud of pair " + std::to_string(i) +
                                                   ": " + std::to_string(sizes[i]) +
                                                   " points, the model needs at least " +
                                                   std::to_string(least));
  return {};
}

Range slice(const BufferSlice& buffer, std::size_t numbers) {
  return {buffer.buffer, buffer.offset, numbers * sizeof(float)};
}

Result<void> record_checked(VkCommandBuffer commands, Plan::Impl& plan, const Bindings& bindings) {
  auto* executor = dynamic_cast<Executor*>(plan.executor.get());
  if (!executor) return fail(ErrorCode::invalid_argument, "the plan is not on a Vulkan device");
  if (!commands) return fail(ErrorCode::invalid_argument, "no command buffer");
  if (!bindings.source_positions.buffer || !bindings.reference_positions.buffer || !bindings.poses.buffer)
    return fail(ErrorCode::invalid_argument, "a buffer of the bindings is missing");
  if (bindings.position_stride < 3)
    return fail(ErrorCode::invalid_argument,
                "position_stride is " + std::to_string(bindings.position_stride) + ", at least 3 is needed");
  const auto& sources = bindings.source_sizes;
  const auto& references = bindings.reference_sizes;
  if (sources.empty() || sources.size() != references.size())
    return fail(ErrorCode::invalid_argument, std::to_string(sources.size()) + " sources and " +
                                                 std::to_string(references.size()) + " references");
  const std::size_t least = least_points(plan.model.config());
  if (auto ok = check_sizes(sources, "source", least); !ok) return ok;
  if (auto ok = check_sizes(references, "reference", least); !ok) return ok;
  const std::uint64_t alignment = executor->context().capabilities().offset_alignment;
  for (const BufferSlice& buffer : {bindings.source_positions, bindings.reference_positions, bindings.poses})
    if (buffer.offset % alignment != 0)
      return fail(ErrorCode::invalid_argument, "a buffer's offset of " + std::to_string(buffer.offset) +
                                                   " is not a multiple of the device's " +
                                                   std::to_string(alignment));

  std::vector<std::uint32_t> sizes(sources.begin(), sources.end());
  sizes.insert(sizes.end(), references.begin(), references.end());
  const auto points = [](std::span<const std::uint32_t> part) {
    return std::accumulate(part.begin(), part.end(), std::size_t{0});
  };
  executor->record(commands,
                   graph::BatchLayout(sizes, static_cast<std::uint32_t>(plan.model.config().num_key_points)),
                   {slice(bindings.source_positions, points(sources) * bindings.position_stride),
                    slice(bindings.reference_positions, points(references) * bindings.position_stride),
                    bindings.position_stride, slice(bindings.poses, sources.size() * 16)});
  return {};
}

}  // namespace

Result<Device> adopt(const AdoptInfo& info) {
  const auto missing = [](const char* what) {
    return fail(ErrorCode::invalid_argument, std::string("adopt: no ") + what);
  };
  if (!info.get_instance_proc_addr) return missing("get_instance_proc_addr");
  if (!info.instance) return missing("instance");
  if (!info.physical_device) return missing("physical device");
  if (!info.device) return missing("device");
  if (!info.queue) return missing("queue");
  if (!info.timeline_semaphore_enabled)
    return fail(ErrorCode::invalid_argument, "adopt: the device must have timelineSemaphore enabled");
  if (!info.lock_queue != !info.unlock_queue)
    return fail(ErrorCode::invalid_argument,
                "adopt: lock_queue and unlock_queue come together or not at all");
  return guarded([&]() -> Result<Device> {
    auto context = std::make_shared<Context>(
        HostDevice{info.get_instance_proc_addr, info.instance, info.physical_device, info.device, info.queue,
                   info.queue_family, info.pipeline_cache, info.allocation, info.lock_queue,
                   info.unlock_queue, info.subgroup_size_control_enabled, info.tier});
    return Internal::device(std::make_shared<ThreadPool>(info.threads), std::move(context));
  });
}

Result<void> record(VkCommandBuffer commands, Plan& plan, const Bindings& bindings) {
  return guarded([&] { return record_checked(commands, Internal::impl(plan), bindings); });
}

}  // namespace bitr::vk
