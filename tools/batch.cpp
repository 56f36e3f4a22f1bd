// bitr batch: many pairs of clouds, a line of results for each.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <bitr/assemble.hpp>
#include <bitr/io.hpp>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <future>
#include <memory>
#include <new>
#include <thread>
#include <utility>

#include "answer.hpp"
#include "api/internal.hpp"
#include "api/pack.hpp"
#include "assembly_report.hpp"
#include "batch_results.hpp"
#include "cloud_input.hpp"
#include "command.hpp"
#include "core/guarded.hpp"
#include "core/hash.hpp"
#include "core/read_ahead.hpp"
#include "device_choice.hpp"
#include "joined_cloud.hpp"
#include "manifest.hpp"
#include "model/weights.hpp"
#include "options.hpp"
#include "pose_file.hpp"

namespace bitr::tool {
namespace {

// More points than this go to the device by themselves.
constexpr std::size_t most_submitted_points = std::size_t{1} << 20;
// After one is lost.
constexpr int most_new_devices = 2;

struct Shard {
  std::uint64_t index = 1, count = 1;
  bool has(std::uint64_t pair) const { return pair % count == index - 1; }
  std::uint64_t size(std::uint64_t pairs) const { return (pairs + count - index) / count; }
  std::uint64_t pair(std::uint64_t i) const { return i * count + index - 1; }
};

struct BatchCommandOptions {
  std::string manifest, folder;
  ModelChoice model;
  bool resume = false, assembled = false;
  std::uint64_t pairs = 16;
  Shard shard;
  CloudOptions clouds;
  AnswerChoice answer;
  RunOptions run;
};

/// A pair with its clouds, or why there are none.
struct Job {
  ManifestEntry entry;
  std::optional<CloudInput> source, reference;
  std::optional<Pose> truth;
  std::string problem;
  bool end = false;  ///< there is no such pair

  InputPair pair() const { return {*source, *reference}; }
  /// That are looked at.
  std::size_t points() const { return problem.empty() ? looked_at(*source) + looked_at(*reference) : 0; }
};

Job end_of_jobs() {
  Job job;
  job.end = true;
  return job;
}

/// What is known of a pair, in the end.
struct Outcome {
  Job job;
  std::optional<Answer> answer;
  bool done() const { return answer || !job.problem.empty(); }
};

/// The shard's pairs from a given one on; to be asked by one thread.
class Jobs {
 public:
  Jobs(Manifest manifest, const BatchCommandOptions& options, const Model* model, std::uint64_t done)
      : manifest_(std::move(manifest)), options_(options), model_(model), done_(done) {}

  Job next() {
    for (;; ++number_) {
      auto entry = manifest_.next();
      if (!entry && entry.error().code == ErrorCode::io)
        throw Failure(entry.error().code, entry.error().message);
      if (entry && !*entry) return end_of_jobs();
      if (!options_.shard.has(number_) || (done_ > 0 && done_-- > 0)) continue;
      Job job;
      if (entry) {
        job.entry = std::move(**entry);
        read_or_say_why(job);
      } else {
        job.entry.number = number_;
        job.entry.name = "pair " + std::to_string(number_);
        job.problem = entry.error().message;
      }
      ++number_;
      return job;
    }
  }

 private:
  void read_or_say_why(Job& job) const try { read(job); } catch (const std::bad_alloc&) {
    job.source.reset();
    job.reference.reset();
    job.problem = job.entry.source + ", " + job.entry.reference + ": out of memory for their points";
  }
  void read(Job& job) const {
    const auto truth = read_optional_pose(job.entry.truth);
    if (!truth) return void(job.problem = truth.error().message);
    job.truth = *truth ? *truth : job.entry.pose;
    for (const auto& [path, input] :
         {std::pair(&job.entry.source, &job.source), {&job.entry.reference, &job.reference}}) {
      auto made = read_input(*path, options_.clouds);
      if (!made) return void(job.problem = made.error().message);
      if (model_) {
        if (const auto checked = check_normals(*made, *model_); !checked)
          return void(job.problem = checked.error().message);
        choose_points(*made, options_.clouds, *model_);
      } else {
        choose_points(*made, options_.clouds);
      }
      *input = std::move(*made);
    }
  }

  Manifest manifest_;
  const BatchCommandOptions& options_;
  const Model* model_;
  std::uint64_t done_, number_ = 0;
};

/// solve(), or a plan that grows with the batches, on a device that is made anew when it is lost.
class Assembler {
 public:
  Assembler(const BatchCommandOptions& options, const Model* model, AnswerOptions how, OpenDevice device)
      : options_(options), model_(model), how_(std::move(how)), device_(std::move(device)) {}

  /// Fills in assemblies or problems. Failure (`device_lost`): no new device takes the lost one's place;
  /// pairs that were not done have neither.
  void run(std::vector<Outcome>& outcomes) {
    std::vector<Outcome*> some;
    std::size_t points = 0;
    for (Outcome& outcome : outcomes) {
      if (!outcome.job.problem.empty()) continue;
      if (!some.empty() && points + outcome.job.points() > most_submitted_points) {
        submit(some);
        some.clear();
        points = 0;
      }
      points += outcome.job.points();
      some.push_back(&outcome);
    }
    submit(some);
  }
  void save_cache() const { device_.save_cache(); }

 private:
  void submit(const std::vector<Outcome*>& outcomes) {
    if (outcomes.empty()) return;
    auto answers = answer_all(outcomes);
    if (answers) {
      for (std::size_t i = 0; i < outcomes.size(); ++i) outcomes[i]->answer = std::move((*answers)[i]);
    } else if (outcomes.size() == 1) {
      Job& job = outcomes.front()->job;
      const bool ours = answers.error().code == ErrorCode::internal;
      job.problem = (ours ? described(*job.source) + ", " + described(*job.reference) + ": " : "") +
                    answers.error().message;
    } else {
      // One of them is not to be assembled; the others should not suffer.
      for (Outcome* outcome : outcomes) submit({outcome});
    }
  }

  Result<std::vector<Answer>> answer_all(const std::vector<Outcome*>& outcomes) {
    std::vector<InputPair> pairs;
    for (const Outcome* outcome : outcomes) pairs.push_back(outcome->job.pair());
    if (!loss_.empty()) renew();
    auto answers = attempt(pairs);
    if (loss_.empty()) return answers;
    renew();
    return attempt(pairs);
  }

  /// A new device that is seen to run, so that a pair that loses every device it meets is told from a device
  /// that is gone.
  void renew() {
    std::string why;
    for (int tries = 0; tries < most_new_devices; ++tries) {
      // A driver may need a moment to recover.
      if (tries > 0) std::this_thread::sleep_for(std::chrono::seconds(1));
      plan_.reset();
      if (auto ran = open_running_device(); !ran) {
        why = ran.error().message;
        continue;
      }
      warn(std::exchange(loss_, {}) + "; going on with a new device");
      return;
    }
    throw Failure(ErrorCode::device_lost, loss_ + "; " + std::to_string(most_new_devices) +
                                              " new devices in a row did not run a tiny pair: " + why);
  }
  Result<void> open_running_device() {
    auto device = open_device(options_.run);
    if (!device) return tl::unexpected(device.error());
    device_ = std::move(*device);
    const auto model = model_ ? Result<Model>(*model_) : untrained_model();
    if (!model) return tl::unexpected(model.error());
    auto plan = make_plan(*device_, *model, {1, 2 * least_points(model->config())}, options_.run.plan);
    if (!plan) return tl::unexpected(plan.error());
    return prewarm(*plan);
  }

  /// Leaves in loss_ whether the device was lost.
  Result<std::vector<Answer>> attempt(const std::vector<InputPair>& pairs) {
    auto answers =
        guarded([&] { return model_ ? answer_with_plan(pairs) : solve_pairs(*device_, pairs, how_); });
    if (!answers && answers.error().code == ErrorCode::device_lost) loss_ = answers.error().message;
    return answers;
  }
  Result<std::vector<Answer>> answer_with_plan(const std::vector<InputPair>& pairs) {
    std::vector<CloudPair> clouds;
    for (const InputPair& pair : pairs) clouds.push_back(pair.used());
    const BatchShape shape = shape_of(clouds);
    if (!plan_ || plan_->capacity().pairs < shape.pairs || plan_->capacity().points < shape.points) {
      BatchShape capacity{std::max<std::size_t>(shape.pairs, options_.pairs), shape.points * 5 / 4};
      if (plan_) capacity.points = std::max(capacity.points, plan_->capacity().points);
      plan_.reset();
      auto plan = make_plan(*device_, *model_, capacity, options_.run.plan);
      if (!plan) return tl::unexpected(plan.error());
      plan_ = std::make_unique<Plan>(std::move(*plan));
    }
    return answer(*plan_, pairs, how_);
  }

  const BatchCommandOptions& options_;
  const Model* model_;  ///< of the network that is asked; null: solve()
  const AnswerOptions how_;
  OpenDevice device_;
  std::unique_ptr<Plan> plan_;
  std::string loss_;  ///< how device_ was lost; empty while it is not
};

Json line_of(const Outcome& outcome, const AnswerChoice& choice, const AnswerOptions& how) {
  const Job& job = outcome.job;
  Json line = {{"pair", job.entry.number},
               {"name", job.entry.name},
               {"source", job.entry.source},
               {"reference", job.entry.reference}};
  if (!outcome.answer) {
    line["status"] = "unreadable";
    line["problem"] = job.problem;
    return line;
  }
  const Answer& answer = *outcome.answer;
  const Assembly& assembly = answer.assembly;
  line["status"] = status_name(assembly.status);
  if (assembly.status == Status::failed) return line;
  line["transform"] = matrix_json(assembly.T_reference_source);
  line["points"] = {{"source", looked_at(*job.source)}, {"reference", looked_at(*job.reference)}};
  if (answer.restricted) line["restriction"] = to_json(*answer.restricted);
  line["diagnostics"] = diagnostics_json(answer);
  if (answer.refinement) line["refinement"] = to_json(*answer.refinement, *how.refine);
  if (answer.confidence) line.update(judgement_json(answer));
  if (const std::string why = refusal(answer, choice); !why.empty()) line["refused"] = why;
  if (job.truth) line["errors"] = errors_json(assembly.T_reference_source, *job.truth);
  return line;
}

std::string assembled_name(std::uint64_t pair) {
  char name[64];
  std::snprintf(name, sizeof name, "pair_%06llu.ply", static_cast<unsigned long long>(pair));
  return name;
}

/// Clouds first, so that what has its line has its cloud.
void write(const std::vector<Outcome>& outcomes, const BatchCommandOptions& options, const AnswerOptions& how,
           BatchResults& results) {
  std::vector<Json> lines;
  for (const Outcome& outcome : outcomes) {
    lines.push_back(line_of(outcome, options.answer, how));
    if (lines.back().contains("refused")) continue;
    if (!options.assembled || !outcome.answer || outcome.answer->assembly.status == Status::failed) continue;
    const auto written =
        io::write_ply(std::filesystem::path(options.folder) / assembled_name(outcome.job.entry.number),
                      joined_cloud(outcome.job.source->cloud, outcome.job.reference->cloud,
                                   outcome.answer->assembly.T_reference_source));
    if (!written) throw Failure(written.error().code, written.error().message);
  }
  results.append(lines);
}

std::string hex(std::uint64_t number) {
  char digits[17];
  std::snprintf(digits, sizeof digits, "%016llx", static_cast<unsigned long long>(number));
  return digits;
}

/// Changes with all that a pose depends on, whatever the model is called.
std::uint64_t fingerprint_of(const Model& model) {
  // Written as they are kept in files, and then in full: a file may hold doubles.
  std::uint64_t fingerprint = fnv1a(serialize(model));
  for (const auto& [name, matrix] : Internal::weights(model).parameters)
    fingerprint =
        fnv1a(std::as_bytes(std::span(matrix.data(), static_cast<std::size_t>(matrix.size()))), fingerprint);
  return fingerprint;
}

// What results depend on.
Json settings_of(const BatchCommandOptions& options, const std::vector<Model>& models,
                 const ManifestSummary& manifest) {
  Json names = Json::array(), fingerprints = Json::array();
  for (const Model& model : models) {
    names.push_back(model.name());
    fingerprints.push_back(hex(fingerprint_of(model)));
  }
  Json settings = {{"manifest", options.manifest},
                   {"manifest_fingerprint", hex(manifest.fingerprint)},
                   {"shard", std::to_string(options.shard.index) + "/" + std::to_string(options.shard.count)},
                   {"solve", !names_network(options.model)},
                   {"models", names},
                   {"model_fingerprints", fingerprints},
                   {"complete_match", options.model.complete_match},
                   {"mode", options.run.plan.mode ? Json(mode_name(*options.run.plan.mode)) : Json(nullptr)},
                   {"precision", precision_name(options.run.plan.precision)},
                   {"as_defined", options.run.plan.as_defined},
                   {"points", optional_json(options.clouds.points)},
                   {"seed", options.clouds.seed},
                   {"assembled", options.assembled}};
  settings.update(to_json(options.answer));
  return settings;
}

class Progress {
 public:
  Progress(std::uint64_t done, std::uint64_t all) : start_(done), all_(all) {}
  double rate(std::uint64_t done) const {
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - began_).count();
    return seconds > 0 ? static_cast<double>(done - start_) / seconds : 0;
  }
  void show(std::uint64_t done) const {
    char text[128];
    const double rate = this->rate(done), left = rate > 0 ? static_cast<double>(all_ - done) / rate : 0;
    std::snprintf(text, sizeof text, "%llu of %llu pairs, %.1f a second, %.0f:%02d to go",
                  static_cast<unsigned long long>(done), static_cast<unsigned long long>(all_), rate,
                  std::floor(left / 60), static_cast<int>(std::fmod(left, 60)));
    show_progress(text);
  }

 private:
  std::uint64_t start_, all_;
  std::chrono::steady_clock::time_point began_ = std::chrono::steady_clock::now();
};

void print(const BatchSummary& summary, const std::string& file, double rate) {
  const auto count = [](std::uint64_t n) { return static_cast<unsigned long long>(n); };
  std::printf("pairs       %llu: %llu ok, %llu degenerate, %llu failed, %llu unreadable\n",
              count(summary.pairs), count(summary.ok), count(summary.degenerate), count(summary.failed),
              count(summary.unreadable));
  if (summary.refused > 0) std::printf("refused     %llu, see \"refused\"\n", count(summary.refused));
  if (summary.confidence.count() > 0)
    std::printf("confidence  median %.2f, mean %.2f\n", summary.confidence.median(),
                summary.confidence.mean());
  if (summary.overlap.count() > 0)
    std::printf("overlap     median %.1f %% of the source\n", 100 * summary.overlap.median());
  const Histogram& errors = summary.rotation_degrees;
  if (errors.count() > 0)
    std::printf("error       rotation median %.2f, mean %.2f degrees; %.1f %% within 5, %.1f %% within 15\n",
                errors.median(), errors.mean(), 100 * errors.share_within(5), 100 * errors.share_within(15));
  std::printf("throughput  %.1f pairs a second\nresults     %s\n", rate, file.c_str());
}

/// Those that are there already, and that this run would replace.
InputFiles assembled_files(const BatchCommandOptions& options) {
  InputFiles files;
  std::error_code error;
  std::filesystem::directory_iterator entry(options.folder, error), end;
  for (; !error && entry != end; entry.increment(error)) {
    unsigned long long number = 0;
    const std::string name = entry->path().filename();
    if (std::sscanf(name.c_str(), "pair_%llu.ply", &number) == 1 && name == assembled_name(number) &&
        options.shard.has(number))
      files.add(entry->path());
  }
  return files;
}

/// The manifest, and that none of its files is one that this run writes.
Result<ManifestSummary> check_manifest(const BatchCommandOptions& options) {
  const InputFiles written = options.assembled ? assembled_files(options) : InputFiles();
  if (written.empty()) return summarise_manifest(options.manifest);
  return summarise_manifest(options.manifest, [&](const ManifestEntry& entry) -> Result<void> {
    for (const std::string* file : {&entry.source, &entry.reference, &entry.truth})
      if (written.has(*file))
        return fail(ErrorCode::invalid_argument, "--assembled: would replace " + *file + ", which " +
                                                     options.manifest + " names in " + entry.name);
    return {};
  });
}

Result<std::string> results_file(const BatchCommandOptions& options) {
  std::error_code error;
  if (const auto made = make_folder("--out", options.folder); !made) return tl::unexpected(made.error());
  std::string name = "results";
  if (options.shard.count > 1)
    name += "-" + std::to_string(options.shard.index) + "-of-" + std::to_string(options.shard.count);
  const std::string file = std::filesystem::path(options.folder) / (name + ".jsonl");
  if (!options.resume && std::filesystem::exists(file, error))
    return fail(ErrorCode::invalid_argument, file + ": is there already; --resume goes on with it");
  if (auto checked = check_output("--out", file, {options.manifest}); !checked)
    return tl::unexpected(checked.error());
  return file;
}

/// The one that is named, or those that solve() asks.
Result<std::vector<Model>> models_of(const BatchCommandOptions& options) {
  std::vector<Model> models;
  if (names_network(options.model)) {
    auto model = choose_model(options.model);
    if (!model) return tl::unexpected(model.error());
    return models.push_back(std::move(*model)), models;
  }
  if (const auto checked = check_solvable(options.run); !checked) return tl::unexpected(checked.error());
  for (const ShippedModel& shipped : shipped_models()) {
    auto model = shipped_model(shipped.name);
    if (!model) return tl::unexpected(model.error());
    models.push_back(std::move(*model));
  }
  return models;
}

int run_checked(BatchCommandOptions& options) {
  options.clouds.strict = options.answer.strict;
  // Who chooses among answers has judged them.
  if (!names_network(options.model)) options.answer.confidence = true;
  auto how = answer_options(options.answer);
  if (!how) return complain(how.error());
  how->complete_match = options.model.complete_match;
  const auto models = models_of(options);
  if (!models) return complain(models.error());
  const Model* model = names_network(options.model) ? &models->front() : nullptr;
  set_at_hand(options.manifest + ", " + std::to_string(options.pairs) + " pairs at once");
  const auto summary = check_manifest(options);
  if (!summary) return complain(summary.error());
  auto manifest = Manifest::open(options.manifest);
  if (!manifest) return complain(manifest.error());
  auto device = open_device(options.run);
  if (!device) return complain(device.error());
  const auto file = results_file(options);
  if (!file) return complain(file.error());

  BatchResults results(*file, settings_of(options, *models, *summary),
                       [&](std::uint64_t i) { return options.shard.pair(i); });
  const std::uint64_t all = options.shard.size(summary->pairs);
  const Progress progress(results.done(), all);
  Assembler assembler(options, model, *how, std::move(*device));
  Jobs jobs(std::move(*manifest), options, model, results.done());
  // Declared after what its thread uses.
  ReadAhead<Job> reader(1, 2 * options.pairs, [&](std::uint64_t) { return jobs.next(); });
  std::future<void> writing;
  std::optional<Failure> lost;
  for (bool end = false; !end;) {
    std::vector<Outcome> outcomes;
    while (!end && outcomes.size() < options.pairs) {
      Job job = reader.next();
      end = job.end;
      if (!end) outcomes.push_back({std::move(job), {}});
    }
    try {
      assembler.run(outcomes);
    } catch (const Failure& failure) {
      if (failure.error().code != ErrorCode::device_lost) throw;
      outcomes.erase(std::ranges::find_if_not(outcomes, &Outcome::done), outcomes.end());
      lost = failure;
      end = true;
    }
    if (writing.valid()) writing.get();
    progress.show(results.done());
    // Where the system grants no thread it is done by whoever waits for it.
    writing = std::async(std::launch::async | std::launch::deferred,
                         [&, outcomes = std::move(outcomes)] { write(outcomes, options, *how, results); });
  }
  writing.get();
  if (lost)
    return complain(run_failed, std::string(lost->what()) + "; " + std::to_string(results.done()) + " of " +
                                    std::to_string(all) + " pairs are in " + *file +
                                    ", --resume goes on with the next");
  assembler.save_cache();
  clear_progress();
  print(results.summary(), *file, progress.rate(results.done()));
  const BatchSummary& found = results.summary();
  const std::uint64_t unusable = found.failed + found.unreadable + found.refused;
  return unusable == 0
             ? done
             : complain(run_failed, std::to_string(unusable) + " of " + std::to_string(found.pairs) +
                                        " pairs have no usable pose; see \"status\" and \"refused\" in " +
                                        *file);
}

int run(BatchCommandOptions& options) {
  try {
    return run_checked(options);
  } catch (const Failure& failure) {
    return complain(failure.error());
  }
}

void parse_shard(const std::string& text, Shard& shard) {
  unsigned long long index = 0, count = 0;
  int length = 0;
  if (std::sscanf(text.c_str(), "%llu/%llu%n", &index, &count, &length) != 2 ||
      static_cast<std::size_t>(length) != text.size() || index < 1 || index > count || count > 1'000'000)
    throw CLI::ValidationError("--shard", "\"" + text + "\" is not I/N with 1 ≤ I ≤ N ≤ 1000000");
  shard = {index, count};
}

}  // namespace

Command add_batch(CLI::App& root) {
  auto options = std::make_shared<BatchCommandOptions>();
  CLI::App* app = add_command(root, "batch", "Assemble the pairs of a manifest");
  app->add_option("MANIFEST", options->manifest, "Table or JSON lines that name the clouds, see below")
      ->required()
      ->type_name("FILE");
  app->add_option("--out", options->folder, "Folder of the results; made if it is missing")
      ->required()
      ->type_name("DIR");
  app->add_flag("--resume", options->resume, "Go on where an interrupted run stopped");
  app->add_option_function<std::string>(
         "--shard", [options](const std::string& text) { parse_shard(text, options->shard); },
         "Take every N-th pair only, from the I-th; for N processes side by side")
      ->type_name("I/N");
  app->add_flag("--assembled", options->assembled,
                "Also write every pair, assembled, to DIR/pair_NUMBER.ply");
  add_count(*app, "--pairs", options->pairs, 1, 4096, "Pairs that go to the device at once");
  add_model_options(*app, options->model, options->run.plan.mode);
  add_cloud_options(*app, options->clouds);
  add_answer_options(*app, options->answer, false);
  add_run_options(*app, options->run);
  app->remove_option(app->get_option("--profile"));  // it is about one assemble()
  app->footer(
      "MANIFEST: a CSV table whose first line names its columns, source, reference and, as wanted, truth (a\n"
      "JSON file with the true pose) and name; or, in a file *.jsonl, a JSON object with these keys per "
      "line.\n"
      "Paths are relative to the manifest's folder.\n"
      "DIR/results.jsonl gets one line per pair, in the manifest's order, as pairs are done; a pair that "
      "cannot\n"
      "be read or assembled gets a line that says why, and the rest goes on.\n"
      "Restricted poses are those of bitr assemble.\n"
      "Exit status: 0 done; 1 done, but some pairs have no usable pose, or the device was lost for good and\n"
      "--resume can do the rest; 2 bad input or usage.\n\n"
      "Examples:\n"
      "  bitr generate aircraft --out clouds --count 100 --seed 1\n"
      "  bitr batch clouds/aircraft.jsonl --out results\n"
      "  bitr batch clouds/aircraft.jsonl --out results --resume\n"
      "  bitr batch clouds/aircraft.jsonl --out results --shard 2/8");
  return {app, [options] { return run(*options); }};
}

}  // namespace bitr::tool
