#include "vk/submitter.hpp"

#include "vk/kernel.hpp"

namespace bitr::vk {

void Submitter::run(const Schedule& schedule) {
  const auto& dispatches = schedule.dispatches();
  if (dispatches.empty()) return;
  std::vector<std::size_t> begins = {0};
  double cost = 0;
  for (std::size_t w = 0; w < dispatches.size(); ++w) {
    if (w > begins.back() && cost + dispatches[w].cost > most_cost) {
      begins.push_back(w);
      cost = 0;
    }
    cost += dispatches[w].cost;
  }
  begins.push_back(dispatches.size());
  const auto& buffers = commands_.buffers(begins.size() - 1);
  recorder_.bind(schedule);
  recorder_.restart();
  for (std::size_t i = 0; i + 1 < begins.size(); ++i) {
    commands_.begin(buffers[i], VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT);
    if (i == 0) recorder_.barrier(buffers[i]);  // what earlier schedules left is there
    recorder_.record(buffers[i], schedule, begins[i], begins[i + 1], {});
    if (begins[i + 1] == dispatches.size()) recorder_.show_host(buffers[i]);
    commands_.end(buffers[i]);
    commands_.submit(buffers[i]);
  }
  commands_.wait();
}

}  // namespace bitr::vk
