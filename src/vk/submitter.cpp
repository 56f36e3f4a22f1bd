#include "vk/submitter.hpp"

#include "vk/kernel.hpp"

namespace bitr::vk {

void Submitter::run(const Schedule& schedule) {
  const auto& works = schedule.works();
  if (works.empty()) return;
  std::vector<std::size_t> begins = {0};
  double cost = 0;
  for (std::size_t w = 0; w < works.size(); ++w) {
    if (w > begins.back() && cost + works[w].cost > most_cost) {
      begins.push_back(w);
      cost = 0;
    }
    cost += works[w].cost;
  }
  begins.push_back(works.size());
  const auto& buffers = commands_.buffers(begins.size() - 1);
  recorder_.bind(schedule);
  recorder_.restart();
  for (std::size_t i = 0; i + 1 < begins.size(); ++i) {
    commands_.begin(buffers[i], VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT);
    recorder_.record(buffers[i], schedule, begins[i], begins[i + 1], {});
    if (begins[i + 1] == works.size()) {
      const VkMemoryBarrier to_host{.sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER,
                                    .pNext = nullptr,
                                    .srcAccessMask = VK_ACCESS_TRANSFER_WRITE_BIT,
                                    .dstAccessMask = VK_ACCESS_HOST_READ_BIT};
      context_.vk().CmdPipelineBarrier(buffers[i], VK_PIPELINE_STAGE_TRANSFER_BIT, VK_PIPELINE_STAGE_HOST_BIT,
                                       0, 1, &to_host, 0, nullptr, 0, nullptr);
    }
    commands_.end(buffers[i]);
    commands_.submit(buffers[i]);
  }
  commands_.wait();
}

}  // namespace bitr::vk
