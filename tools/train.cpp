// bitr train: a model from shapes.
#include <CLI/CLI.hpp>
#include <bitr/io.hpp>
#include <bitr/train.hpp>
#include <chrono>
#include <cmath>
#include <csignal>
#include <iostream>
#include <memory>

#include "command.hpp"
#include "device_choice.hpp"
#include "options.hpp"
#include "output.hpp"

namespace bitr::tool {
namespace {

struct TrainCommandOptions {
  std::string config, out, init;
  std::vector<std::string> kinds, folders, settings;
  std::vector<TrainOverride> overrides;  ///< from the options that stand for one setting
  bool resume = false, print_config = false;
  DeviceChoice device;
};

volatile std::sig_atomic_t interrupted = 0;

void catch_signals() {
  struct sigaction action = {};
  action.sa_handler = [](int) { interrupted = 1; };
  action.sa_flags = static_cast<int>(SA_RESETHAND);  // a second one ends the process at once
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

std::string plural(std::size_t count, const std::string& what) {
  return std::to_string(count) + " " + what + (count == 1 ? "" : "s");
}

std::string decimal(double value, const char* format = "%.3g") {
  char text[40];
  std::snprintf(text, sizeof text, format, value);
  return text;
}

std::string duration(double seconds) {
  const auto whole = static_cast<long long>(seconds + 0.5);
  if (whole < 60) return std::to_string(whole) + " s";
  if (whole < 3600) return std::to_string(whole / 60) + " min " + std::to_string(whole % 60) + " s";
  return std::to_string(whole / 3600) + " h " + std::to_string(whole / 60 % 60) + " min";
}

/// Parts of the data by --kind and --data, in place of the configuration's.
void add_parts(const TrainCommandOptions& options, std::vector<TrainOverride>& overrides) {
  Json parts = Json::array();
  std::string label;
  for (const std::string& kind : options.kinds) {
    parts.push_back({{"kind", kind}});
    label = "--kind " + kind;
  }
  for (const std::string& folder : options.folders) {
    parts.push_back({{"folder", folder}});
    label = "--data " + folder;
  }
  if (!parts.empty()) overrides.push_back({"data.parts", parts.dump(), label});
}

Result<TrainOptions> resolve(const TrainCommandOptions& options) {
  std::string json = "{}", file = "command line";
  if (!options.config.empty()) {
    const auto bytes = io::read_file(options.config);
    if (!bytes) return tl::unexpected(bytes.error());
    json.assign(reinterpret_cast<const char*>(bytes->data()), bytes->size());
    file = options.config;
  } else if (options.resume) {
    const auto checkpoint = TrainFiles{options.out}.checkpoint();
    if (std::filesystem::exists(checkpoint)) {
      const auto stored = checkpoint_options(checkpoint);
      if (!stored) return tl::unexpected(stored.error());
      json = to_json(*stored);
      file = checkpoint.string();
    }
  }
  std::vector<TrainOverride> overrides;
  add_parts(options, overrides);
  overrides.insert(overrides.end(), options.overrides.begin(), options.overrides.end());
  for (const std::string& setting : options.settings) {
    const std::size_t equals = setting.find('=');
    if (equals == std::string::npos || equals == 0)
      return fail(ErrorCode::invalid_argument, "--set " + setting + ": must be KEY=VALUE");
    overrides.push_back({setting.substr(0, equals), setting.substr(equals + 1), "--set " + setting});
  }
  return parse_train_options(json, file, overrides);
}

Result<void> check(const TrainCommandOptions& options, const TrainOptions& resolved) {
  if (options.out.empty()) return fail(ErrorCode::invalid_argument, "--out is required: the model to write");
  if (std::filesystem::path(options.out).extension() != ".safetensors")
    return fail(ErrorCode::invalid_argument, "--out " + options.out + ": must end in .safetensors");
  const TrainFiles files{options.out};
  for (const auto& path : {files.model, files.last(), files.checkpoint(), files.metrics(), files.curves()})
    if (auto checked = check_output("--out", path.string(), {options.config, resolved.init.string()});
        !checked)
      return checked;
  if (resolved.data.parts.empty())
    return fail(ErrorCode::invalid_argument,
                "nothing to train on: give --kind KIND, --data FOLDER, or data.parts in a configuration");
  return {};
}

void print(const ValidationResult& validation, const TrainProgress& progress) {
  clear_progress();
  std::cout << "step " << validation.step << " of " << progress.steps;
  for (const ValidationGroup& group : validation.groups)
    std::cout << "; " << group.name << ": " << decimal(group.errors.rotation.median) << "° "
              << decimal(group.errors.translation.median) << ", flips " << decimal(100 * group.errors.flips)
              << " %";
  std::cout << (validation.best ? " (best)" : "") << "; " << decimal(progress.pairs_per_second)
            << " pairs/s, " << duration(progress.seconds_left) << " left" << std::endl;
}

/// The line on the terminal, a few times a second, and one that stays for each validation.
class Display {
 public:
  void show(const TrainProgress& progress) {
    started_ = true;
    if (std::isfinite(progress.loss)) {
      const double weight = std::max(1.0 / static_cast<double>(++steps_), 0.02);
      rotation_ += weight * (progress.rotation - rotation_);
      translation_ += weight * (progress.translation - translation_);
    }
    if (progress.validation) print(*progress.validation, progress);
    const auto now = std::chrono::steady_clock::now();
    if (now < next_) return;
    next_ = now + std::chrono::milliseconds(200);
    const std::size_t skipped = progress.skipped_steps;
    show_progress("step " + std::to_string(progress.step) + " of " + std::to_string(progress.steps) +
                  ", loss " + decimal(rotation_) + " + " + decimal(translation_) + ", lr " +
                  decimal(progress.lr) + ", " + decimal(progress.pairs_per_second) + " pairs/s, " +
                  duration(progress.seconds_left) + " left" +
                  (skipped ? ", " + plural(skipped, "step") + " skipped" : ""));
  }

  bool started() const { return started_; }

 private:
  bool started_ = false;
  std::size_t steps_ = 0;
  double rotation_ = 0, translation_ = 0;
  std::chrono::steady_clock::time_point next_ = {};
};

void print(const TrainSummary& summary, const TrainFiles& files) {
  const auto count = summary.step - summary.first_step;
  const char* why[] = {"finished", "no better for long enough, stopped", "out of time, stopped", "stopped"};
  std::cout << why[static_cast<int>(summary.end)] << " at step " << summary.step << " after "
            << duration(summary.seconds);
  if (count) std::cout << " (" << plural(count, "step") << ")";
  if (summary.skipped_steps) std::cout << "; " << plural(summary.skipped_steps, "step") << " skipped";
  if (summary.skipped_samples) std::cout << "; " << plural(summary.skipped_samples, "sample") << " skipped";
  if (summary.best_score)
    std::cout << "; best: " << decimal(*summary.best_score) << "° at step " << summary.best_step;
  std::cout << "\n" << files.model.string() << '\n';
  if (summary.end == TrainEnd::stopped || summary.end == TrainEnd::time_limit)
    std::cout << "go on with: bitr train --resume --out " << files.model.string() << '\n';
  if (!summary.skipped_shapes.empty())
    warn(plural(summary.skipped_shapes.size(), "shape") + " cannot be used; " +
         summary.skipped_shapes[0].shape + ": " + summary.skipped_shapes[0].reason);
}

int run(TrainCommandOptions& options) {
  const auto resolved = resolve(options);
  if (!resolved) return complain(resolved.error());
  if (options.print_config) {
    std::cout << to_json(*resolved) << '\n';
    return done;
  }
  if (const auto checked = check(options, *resolved); !checked) return complain(checked.error());
  set_at_hand("batches of " + std::to_string(resolved->batch) + " pairs of up to " +
              std::to_string(resolved->data.points_high) + " points");
  const auto device = open_device(options.device);
  if (!device) return complain(device.error());
  catch_signals();

  const TrainFiles files{options.out};
  Display display;
  show_progress("preparing");
  const auto summary =
      train_model(**device, *resolved, files, options.resume,
                  {.progress = [&](const TrainProgress& progress) { display.show(progress); },
                   .stop = [] { return interrupted != 0; }});
  clear_progress();
  if (!summary)
    return display.started() ? complain(run_failed, summary.error().message) : complain(summary.error());
  device->save_cache();
  print(*summary, files);
  return done;
}

void add_setting(CLI::App& app, TrainCommandOptions& options, const std::string& name, const std::string& key,
                 const std::string& type, const std::string& description) {
  app.add_option_function<std::string>(
         name,
         [&options, name, key](const std::string& text) {
           options.overrides.push_back({key, text, name + " " + text});
         },
         description)
      ->type_name(type);
}

}  // namespace

Command add_train(CLI::App& root) {
  auto options = std::make_shared<TrainCommandOptions>();
  CLI::App* app = add_command(root, "train", "Train a model on procedural shapes or on your own");
  app->add_option("CONFIG", options->config, "Settings, JSON with comments; see --print-config")
      ->type_name("FILE");
  app->add_option("--kind", options->kinds, "Train on procedural shapes: aircraft, vessels, fragments")
      ->type_name("KIND");
  app->add_option("--data", options->folders, "Train on the meshes and clouds in this folder and below")
      ->type_name("FOLDER");
  app->add_option("--out", options->out, "The model to write; what else is written has its name as well")
      ->type_name("FILE.safetensors");
  app->add_flag("--resume", options->resume,
                "Go on from the checkpoint, if there is one; its settings count unless CONFIG is given");
  add_setting(*app, *options, "--steps", "steps", "N", "Steps of the whole run");
  add_setting(*app, *options, "--batch", "batch", "N", "Pairs of one step");
  add_setting(*app, *options, "--seed", "seed", "N", "Seed of the weights and of the data");
  add_setting(*app, *options, "--minutes", "minutes", "T", "Stop after this long; --resume goes on");
  add_setting(*app, *options, "--init", "init", "MODEL", "Start from this model, not from random weights");
  app->add_option("--set", options->settings, "Any setting: optimizer.lr=1e-3, data.points=[512,2048], …")
      ->type_name("KEY=VALUE");
  app->add_flag("--print-config", options->print_config, "Print all settings as they are now, and stop");
  add_device_options(*app, options->device);
  app->footer(
      "Beside FILE.safetensors, the best model of the validations so far, it writes FILE.last.safetensors,\n"
      "FILE.checkpoint for --resume, FILE.metrics.jsonl and FILE.curves.svg, a picture of the run.\n"
      "Ctrl-C stops with a checkpoint. Folders in the settings are relative to where the command runs.\n\n"
      "Examples:\n"
      "  bitr train --kind aircraft --steps 20000 --out aircraft.safetensors\n"
      "  bitr train --data my_meshes --minutes 30 --out mine.safetensors\n"
      "  bitr train --resume --out mine.safetensors\n"
      "  bitr train models/aircraft.json --set optimizer.lr=1e-3 --print-config");
  return {app, [options] { return run(*options); }};
}

}  // namespace bitr::tool
