// What a dispatch of nothing costs within a submission, with and without a barrier before it (1,024 of them;
// a time is of all), and what the submission costs.
#include "api/internal.hpp"
#include "commands.hpp"
#include "nothing.spv.hpp"
#include "vk/device.hpp"

namespace bitr::bench {
namespace {

// What they are said to touch decides about barriers.
constexpr vk::Access reading[] = {vk::Access::read}, writing[] = {vk::Access::write};
using Nothing = std::remove_const_t<decltype(vk::shaders::nothing)>;
constexpr Nothing independent{"nothing_read", vk::shaders::nothing_spirv, reading};
constexpr Nothing dependent{"nothing_written", vk::shaders::nothing_spirv, writing};

std::shared_ptr<Commands> commands_of(const vk::Context& context, const Nothing& shader,
                                      const vk::Buffer& buffer, int dispatches) {
  const auto pipeline = context.pipeline(shader, std::array{1u});
  vk::Schedule schedule;
  for (int i = 0; i < dispatches; ++i)
    schedule.dispatch(pipeline, {{buffer.handle(), 0, buffer.size()}}, {1, 1, 1}, 0);
  return std::make_shared<Commands>(context, schedule);
}

void one_more(benchmark::State& state, const vk::Context& context, const Nothing& shader) {
  constexpr int many = 1025;
  const vk::Buffer buffer(context, 256, false);
  const auto one = commands_of(context, shader, buffer, 1), all = commands_of(context, shader, buffer, many);
  double total = 0;
  for (auto _ : state) {
    const double seconds = std::max(0.0, all->run() - one->run());
    state.SetIterationTime(seconds);
    total += seconds;
  }
  state.counters["us_per_dispatch"] =
      benchmark::Counter(1e6 * total / (many - 1), benchmark::Counter::kAvgIterations);
}

void submission(benchmark::State& state, const vk::Context& context) {
  const vk::Buffer buffer(context, 256, false);
  const auto one = commands_of(context, independent, buffer, 1);
  for (auto _ : state) state.SetIterationTime(one->run());
}

}  // namespace

void register_dispatches(const Run& run) {
  if (run.counters) return;
  for (const Device& device : run.devices) {
    if (!Internal::context(device)) continue;
    const auto add = [&](const char* what, auto body) {
      benchmark::RegisterBenchmark((std::string("dispatch/") + what + "/vulkan").c_str(),
                                   [device, body](benchmark::State& state) {
                                     guarded(state, [&] { body(state, *Internal::context(device)); });
                                   })
          ->UseManualTime()
          ->Unit(benchmark::kMicrosecond);
    };
    add("independent",
        [](auto& state, const vk::Context& context) { one_more(state, context, independent); });
    add("after_barrier",
        [](auto& state, const vk::Context& context) { one_more(state, context, dependent); });
    add("submission", submission);
  }
}

}  // namespace bitr::bench
