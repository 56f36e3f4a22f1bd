// bitr bench: how long forward passes take.
#include <sys/resource.h>
#include <unistd.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <bitr/assemble.hpp>
#include <bitr/generate.hpp>
#include <chrono>
#include <cmath>
#include <fstream>
#include <map>
#include <memory>

#include "command.hpp"
#include "device_choice.hpp"
#include "options.hpp"
#include "output.hpp"

namespace bitr::tool {
namespace {

struct BenchOptions {
  bool model_forward = false;
  std::string json, model;
  std::uint64_t points = 2048, pairs = 1, repeats = 30;
  std::optional<Mode> mode;
  RunOptions run;
};

/// The value that `share` of the samples do not exceed (nearest rank).
double quantile(std::vector<double> samples, double share) {
  std::sort(samples.begin(), samples.end());
  const auto rank = static_cast<std::size_t>(std::ceil(share * static_cast<double>(samples.size())));
  return samples[std::max<std::size_t>(rank, 1) - 1];
}

std::uint64_t resident_bytes() {
  std::uint64_t total = 0, resident = 0;
  std::ifstream("/proc/self/statm") >> total >> resident;
  return resident * static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE));
}

std::uint64_t peak_resident_bytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<std::uint64_t>(usage.ru_maxrss) * 1024;
}

struct Measurement {
  std::vector<double> batch_ms;
  std::vector<std::string> stages;  ///< in the order they run
  std::map<std::string, std::vector<double>> stage_ms;
};

Result<Measurement> measure(Plan& plan, const std::vector<CloudPair>& pairs, std::uint64_t repeats) {
  constexpr std::uint64_t warm_up = 3;
  const AssembleOptions how = {.diagnostics = false};
  Measurement measured;
  for (std::uint64_t pass = 0; pass < warm_up + repeats; ++pass) {
    const auto start = std::chrono::steady_clock::now();
    const auto assemblies = assemble(plan, pairs, how);
    const std::chrono::duration<double, std::milli> elapsed = std::chrono::steady_clock::now() - start;
    if (!assemblies) return tl::unexpected(assemblies.error());
    show_progress(std::to_string(pass + 1) + " of " + std::to_string(warm_up + repeats));
    if (pass < warm_up) continue;
    measured.batch_ms.push_back(elapsed.count());
    std::map<std::string, double> in_pass;
    for (const StageTime& stage : plan.timings()) {
      if (!measured.stage_ms.contains(stage.stage)) measured.stages.push_back(stage.stage);
      measured.stage_ms[stage.stage];
      in_pass[stage.stage] += stage.milliseconds;
    }
    for (const auto& [stage, milliseconds] : in_pass) measured.stage_ms[stage].push_back(milliseconds);
  }
  clear_progress();
  return measured;
}

void print(const Json& json) {
  std::printf(
      "%s points × %s pairs, %s on %s, %s threads: median %.3f ms, min %.3f, p90 %.3f; %.1f pairs/s\n",
      json["points"].dump().c_str(), json["pairs"].dump().c_str(),
      json["precision"].get<std::string>().c_str(), json["device"].get<std::string>().c_str(),
      json["threads"].dump().c_str(), json["median_ms"].get<double>(), json["min_ms"].get<double>(),
      json["p90_ms"].get<double>(), json["pairs_per_s"].get<double>());
  for (const auto& [stage, milliseconds] : json["stages_ms"].items())
    std::printf("  %-24s %9.3f ms\n", stage.c_str(), milliseconds.get<double>());
}

int run(BenchOptions& options) {
  if (!options.model_forward) return complain(bad_usage, "bench: nothing chosen; give --model-forward");
  const auto checked =
      check_outputs({{"--json", options.json}, profile_output(options.run)}, {options.model});
  if (!checked) return complain(checked.error());
  set_at_hand(std::to_string(options.pairs) + " pairs of " + std::to_string(options.points) + " points");
  options.run.plan.mode = options.mode;
  const auto model = options.model.empty() ? untrained_model() : find_model(options.model);
  if (!model) return complain(model.error());

  std::vector<GeneratedPair> clouds;
  std::vector<CloudPair> pairs;
  for (std::uint64_t i = 0; i < options.pairs; ++i) {
    auto pair = generate_pair("fragments", {.points = options.points, .seed = i});
    if (!pair) return complain(pair.error());
    clouds.push_back(std::move(*pair));
  }
  for (const GeneratedPair& pair : clouds) pairs.push_back({pair.source, pair.reference});

  const auto device = open_device(options.run);
  if (!device) return complain(device.error());
  const std::uint64_t baseline = resident_bytes();
  auto plan = make_plan(**device, *model, shape_of(pairs), options.run.plan);
  if (!plan) return complain(plan.error());
  const auto measured = measure(*plan, pairs, options.repeats);
  if (!measured) return complain(measured.error());
  device->save_cache();

  Json stages = Json::object();
  for (const std::string& stage : measured->stages)
    stages[stage] = quantile(measured->stage_ms.at(stage), 0.5);
  const double median = quantile(measured->batch_ms, 0.5);
  const bool vulkan = (*device)->backend() == Backend::vulkan;
  const auto counted = [&](std::size_t PlanCounters::*counter) {
    return vulkan ? Json(plan->counters().*counter) : Json(nullptr);
  };
  const Json json = {{"points", options.points},
                     {"pairs", options.pairs},
                     {"repeats", options.repeats},
                     {"median_ms", median},
                     {"min_ms", quantile(measured->batch_ms, 0)},
                     {"p90_ms", quantile(measured->batch_ms, 0.9)},
                     {"pairs_per_s", 1000 * static_cast<double>(options.pairs) / median},
                     {"stages_ms", stages},
                     {"operations", plan->operation_count()},
                     {"workspace_bytes", plan->workspace_bytes()},
                     {"arena_bytes", plan->workspace_bytes()},
                     {"dispatches", counted(&PlanCounters::dispatches)},
                     {"barriers", counted(&PlanCounters::barriers)},
                     {"copies", counted(&PlanCounters::copies)},
                     {"submissions", counted(&PlanCounters::submissions)},
                     {"baseline_rss_bytes", baseline},
                     {"peak_rss_bytes", peak_resident_bytes()},
                     {"model", model->name()},
                     {"mode", mode_name(plan->mode())},
                     {"backend", name((*device)->backend())},
                     {"device", (*device)->name()},
                     {"driver", (*device)->driver()},
                     {"threads", (*device)->threads()},
                     {"precision", precision_name(options.run.plan.precision)},
                     {"as_defined", options.run.plan.as_defined}};
  if (options.json != "-") print(json);
  const auto written = write_files({profile_writer(options.run, *plan), json_writer(options.json, json)});
  return written ? done : complain(written.error());
}

}  // namespace

Command add_bench(CLI::App& root) {
  auto options = std::make_shared<BenchOptions>();
  CLI::App* app = add_command(root, "bench", "Measure how long forward passes take");
  app->add_flag("--model-forward", options->model_forward, "Whole forward passes on generated pairs");
  add_count(*app, "--points", options->points, 1, max_generated_points, "Points of each cloud");
  add_count(*app, "--pairs", options->pairs, 1, 4096, "Pairs in a batch");
  add_count(*app, "--repeats", options->repeats, 1, 1'000'000, "Batches to time, after three to warm up");
  add_model(*app, options->model, "untrained ones unless given");
  add_mode(*app, options->mode, "Norms without their eps (scale-exact) or with it (reference)");
  add_run_options(*app, options->run);
  add_json(*app, options->json);
  app->footer(
      "Times are of a batch, in milliseconds, from views of the clouds to poses; diagnostics are off.\n\n"
      "Example:\n"
      "  bitr bench --model-forward --points 2048 --pairs 8 --threads 4 --json bench.json");
  return {app, [options] { return run(*options); }};
}

}  // namespace bitr::tool
