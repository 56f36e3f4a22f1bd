// What a device reaches at best, to hold the operations against.
#include <Eigen/Core>
#include <cstring>
#include <map>

#include "api/internal.hpp"
#include "commands.hpp"
#include "copy.spv.hpp"
#include "core/thread_pool.hpp"
#include "vk/device.hpp"

// Push constants of shaders/fma.comp.
namespace bitr::vk {
struct FmaParameters {
  float factor, term;
};
}  // namespace bitr::vk
#include "fma.spv.hpp"

namespace bitr::bench {
namespace {

constexpr std::size_t copied_bytes = std::size_t{64} << 20;

/// One way to load a device: passes of so many operations or bytes, a pass in seconds.
struct Load {
  double amount;
  std::function<double()> pass;
};

using Clock = std::chrono::steady_clock;

// Every thread multiplies matrices of its own.
constexpr int product_size = 512;
struct Operands {
  Eigen::MatrixXf a = random(), b = random(), c = random();
  static Eigen::MatrixXf random() { return Eigen::MatrixXf::Random(product_size, product_size); }
};

Load product(ThreadPool& pool) {
  const auto all = std::make_shared<std::vector<Operands>>(pool.threads());
  return {2.0 * product_size * product_size * product_size * pool.threads(), [&pool, all] {
            const auto start = Clock::now();
            pool.parallel_for(all->size(), 1, [&](std::size_t begin, std::size_t end) {
              for (std::size_t i = begin; i < end; ++i) (*all)[i].c.noalias() = (*all)[i].a * (*all)[i].b;
            });
            return seconds_between(start, Clock::now());
          }};
}

Load copy(ThreadPool& pool) {
  const auto from = std::make_shared<std::vector<char>>(copied_bytes, 1);
  const auto to = std::make_shared<std::vector<char>>(copied_bytes, 0);
  return {2.0 * copied_bytes, [&pool, from, to] {
            const auto start = Clock::now();
            pool.parallel_for(copied_bytes, copied_bytes / pool.threads(),
                              [&](std::size_t begin, std::size_t end) {
                                std::memcpy(to->data() + begin, from->data() + begin, end - begin);
                              });
            return seconds_between(start, Clock::now());
          }};
}

constexpr std::uint32_t group = 64;

// As many equal dispatches in one submission as make the submission's own cost small.
Load repeated(const vk::Context& context, double amount, auto add_dispatch) {
  for (int count = 1;; count *= 2) {
    vk::Schedule schedule;
    for (int i = 0; i < count; ++i) add_dispatch(schedule);
    const auto commands = std::make_shared<Commands>(context, schedule);
    if (commands->run() > 0.01 || count >= 64)
      return {amount * count, [commands] { return commands->run(); }};
  }
}

Load multiply_add(const vk::Context& context) {
  constexpr std::uint32_t groups = 4096;
  constexpr double rounds = 2048, chains = 12;  // as in shaders/fma.comp
  const auto result = std::make_shared<vk::Buffer>(context, groups * group * sizeof(float), false);
  const auto pipeline = context.pipeline(vk::shaders::fma, std::array{group});
  Load load = repeated(context, 2 * rounds * chains * groups * group, [&](vk::Schedule& schedule) {
    schedule.dispatch(pipeline, {{result->handle(), 0, result->size()}}, {0.999f, 0.001f}, {groups, 1, 1}, 0);
  });
  return {load.amount, [load, result] { return load.pass(); }};
}

Load copy(const vk::Context& context) {
  const auto from = std::make_shared<vk::Buffer>(context, copied_bytes, false);
  const auto to = std::make_shared<vk::Buffer>(context, copied_bytes, false);
  const auto pipeline = context.pipeline(vk::shaders::copy, std::array{group});
  Load load = repeated(context, 2.0 * copied_bytes, [&](vk::Schedule& schedule) {
    schedule.dispatch(pipeline, {{from->handle(), 0, copied_bytes}, {to->handle(), 0, copied_bytes}},
                      {copied_bytes / (16 * 4 * group), 1, 1}, 0);
  });
  return {load.amount, [load, from, to] { return load.pass(); }};
}

Load arithmetic_of(const Device& device) {
  return Internal::context(device) ? multiply_add(*Internal::context(device))
                                   : product(Internal::pool(device));
}
Load memory_of(const Device& device) {
  return Internal::context(device) ? copy(*Internal::context(device)) : copy(Internal::pool(device));
}

// The fastest of the passes that a quarter of a second has room for.
double best_rate(const Load& load) {
  double best = 0, total = 0;
  for (int i = 0; i < 5 || total < 0.25; ++i) {
    const double seconds = load.pass();
    best = std::max(best, load.amount / seconds);
    total += seconds;
  }
  return best;
}

void measure(benchmark::State& state, const Load& load, const char* unit) {
  for (auto _ : state) state.SetIterationTime(load.pass());
  state.counters[unit] =
      benchmark::Counter(1e-9 * load.amount, benchmark::Counter::kIsIterationInvariantRate);
}

}  // namespace

const Ceiling& ceiling(const Device& device) {
  static std::map<Backend, Ceiling> measured;
  const auto found = measured.find(device.backend());
  if (found != measured.end()) return found->second;
  return measured[device.backend()] = {best_rate(arithmetic_of(device)), best_rate(memory_of(device))};
}

void report_rates(benchmark::State& state, const Device& device, double flops, double bytes) {
  const Ceiling& best = ceiling(device);
  const auto rate = [&](const char* name, double amount) {
    if (amount > 0)
      state.counters[name] = benchmark::Counter(amount, benchmark::Counter::kIsIterationInvariantRate);
  };
  rate("GFLOP/s", 1e-9 * flops);
  rate("GB/s", 1e-9 * bytes);
  rate("flop_share", flops / best.flops);
  rate("byte_share", bytes / best.bytes);
}

void register_ceilings(const Run& run) {
  if (run.counters) return;
  for (const Device& device : run.devices) {
    const std::string backend(name(device.backend()));
    const auto add = [&](const std::string& what, auto load, const char* unit) {
      benchmark::RegisterBenchmark(
          (what + "/" + backend).c_str(),
          [=](benchmark::State& state) { guarded(state, [&] { measure(state, load(device), unit); }); })
          ->UseManualTime()
          ->Unit(benchmark::kMillisecond);
    };
    add("ceiling/arithmetic", arithmetic_of, "GFLOP/s");
    add("ceiling/memory", memory_of, "GB/s");
  }
}

}  // namespace bitr::bench
