// What the parts of bitr_bench share.
#pragma once

#include <benchmark/benchmark.h>

#include <bitr/device.hpp>
#include <bitr/generate.hpp>
#include <chrono>
#include <cstdint>
#include <exception>
#include <string>
#include <vector>

namespace bitr::bench {

struct Size {
  std::uint32_t points;  ///< in each cloud
  std::uint32_t pairs;
  std::string str() const { return std::to_string(points) + "x" + std::to_string(pairs); }
};

struct Run {
  std::vector<Device> devices;
  bool counters = false;  ///< only what never depends on time, of small batches
};

void register_ceilings(const Run& run);
void register_dispatches(const Run& run);
void register_nodes(const Run& run);
void register_model(const Run& run);
void register_training(const Run& run);

/// Generated fragments, the same for every run.
std::vector<GeneratedPair> make_pairs(Size size);

/// What a device reaches at best: dense products and copies on the CPU, multiply-adds in registers and copies
/// of a buffer on Vulkan. Measured once.
struct Ceiling {
  double flops = 0, bytes = 0;  ///< a second
};
const Ceiling& ceiling(const Device& device);

/// Rates of work done once per iteration, and their shares of the device's ceiling.
void report_rates(benchmark::State& state, const Device& device, double flops, double bytes);

/// Runs `body`, which may throw; a failure becomes the benchmark's.
template <class Body>
void guarded(benchmark::State& state, const Body& body) try {
  body();
} catch (const std::exception& error) {
  state.SkipWithError(error.what());
}

/// Registers measure(state, device) for every device, in milliseconds that the host sees.
template <class Measure>
void register_whole(const Run& run, const std::string& what, const Measure& measure) {
  for (const Device& device : run.devices)
    benchmark::RegisterBenchmark(
        (what + "/" + std::string(name(device.backend()))).c_str(),
        [=](benchmark::State& state) { guarded(state, [&] { measure(state, device); }); })
        ->UseRealTime()
        ->Unit(benchmark::kMillisecond);
}

inline double seconds_between(auto start, auto end) {
  return std::chrono::duration<double>(end - start).count();
}

}  // namespace bitr::bench
