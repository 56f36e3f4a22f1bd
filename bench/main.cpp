// bitr_bench: every operation alone, the whole network and training steps, on the CPU and on a Vulkan device.
//   BITR_DEVICE  index or part of the name of the Vulkan device (default: the best; without any, the CPU
//   alone)
//   --counters   on Vulkan only: what does not depend on time, for bench/compare.py --counters
// and the options of Google Benchmark.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "bench.hpp"

namespace {

using namespace bitr;

bool take_flag(int& argc, char** argv, const char* flag) {
  char** end = std::remove_if(argv + 1, argv + argc, [&](char* arg) { return std::strcmp(arg, flag) == 0; });
  const bool found = end != argv + argc;
  argc = static_cast<int>(end - argv);
  return found;
}

}  // namespace

int main(int argc, char** argv) {
  bench::Run run;
  run.counters = take_flag(argc, argv, "--counters");
  if (!run.counters) run.devices.push_back(cpu_device());
  const char* wanted = std::getenv("BITR_DEVICE");
  if (auto device = create_device({.device = wanted ? wanted : ""})) {
    run.devices.push_back(*device);
    benchmark::AddCustomContext("device", device->name());
    benchmark::AddCustomContext("driver", device->driver());
    benchmark::AddCustomContext("tier", device->tier());
  } else if (wanted || run.counters || device.error().code != ErrorCode::no_device) {
    std::fprintf(stderr, "bitr_bench: %s\n", device.error().message.c_str());
    return 1;
  }
  benchmark::AddCustomContext("processor", cpu_device(1).name());
  benchmark::AddCustomContext("threads", std::to_string(cpu_device().threads()));

  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  bench::register_ceilings(run);
  bench::register_dispatches(run);
  bench::register_nodes(run);
  bench::register_model(run);
  bench::register_training(run);
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
}
