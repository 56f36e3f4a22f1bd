// bitr eval: how far models and methods are from the truth, on pairs that are made for it.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <bitr/data.hpp>
#include <bitr/evaluate.hpp>
#include <bitr/picture.hpp>
#include <bitr/train.hpp>
#include <memory>

#include "answer.hpp"
#include "api/internal.hpp"
#include "command.hpp"
#include "core/finite.hpp"
#include "core/thread_pool.hpp"
#include "device_choice.hpp"
#include "eval_methods.hpp"
#include "eval_page.hpp"
#include "eval_report.hpp"
#include "generate/pairs.hpp"
#include "options.hpp"
#include "output.hpp"
#include "pair_list.hpp"
#include "shape_files.hpp"
#include "stopwatch.hpp"

namespace bitr::tool {
namespace {

struct EvalCommandOptions {
  MethodChoice methods;
  std::string kind, folder, pairs, json, csv, html;
  std::optional<Protocol> protocol;
  std::vector<double> shares;
  std::vector<std::uint64_t> points;
  std::optional<Split> asked_split;
  Split split = Split::test;  ///< what it comes to
  std::uint64_t shapes = 10'000, samples = 0, seed = 0, batch = 8;
  double noise = 0.01;
  bool same_points = false, confidence = false;
  std::optional<int> asked_answers;
  int answers() const { return asked_answers.value_or(usual_answers); }
  std::optional<double> keep;
  DeviceChoice device;
};

struct Setting {
  std::string protocol;
  std::optional<double> share;
  double keep;
  std::uint64_t points = 0;
};

const std::vector<std::pair<std::string, Split>> split_names = {
    {"test", Split::test}, {"validation", Split::validation}, {"train", Split::train}, {"all", Split::all}};

std::string split_name(Split split) {
  return std::find_if(split_names.begin(), split_names.end(),
                      [&](const auto& known) { return known.second == split; })
      ->first;
}

tl::unexpected<Error> wrong(const std::string& message) { return fail(ErrorCode::invalid_argument, message); }

/// Share of a cloud's points that have a counterpart where clouds only meet.
constexpr double seam = 0.2;

/// What ICP keeps unless it is told: the share of a cloud that surely has a counterpart, or half by chance.
double usual_keep(Protocol protocol, double share) {
  if (protocol == Protocol::opposed) return std::max(seam, (2 * share - 1) / share);
  return protocol == Protocol::independent ? 0.5 : seam;
}

/// The kind's own way to make pairs; files are cropped.
Result<generate::PairOrigin> origin_of(const EvalCommandOptions& options) {
  const int given = !options.kind.empty() + !options.folder.empty() + !options.pairs.empty();
  if (given != 1)
    return wrong(given == 0 ? "eval: nothing to evaluate on; give --kind, --data or --pairs"
                            : "--kind, --data and --pairs: give one of them");
  if (options.kind.empty()) return generate::PairOrigin::cropped;
  const auto kind = generate::kind_named(options.kind);
  if (!kind) return tl::unexpected(kind.error());
  return (*kind)->origin;
}

/// Pairs are as they are: only how many of their points are used may vary.
Result<std::vector<Setting>> settings_of_pairs(EvalCommandOptions& options) {
  if (options.points.empty()) options.points = {1024};
  std::vector<Setting> settings;
  for (const std::uint64_t points : options.points)
    settings.push_back({"pairs", {}, options.keep.value_or(0.5), points});
  return settings;
}

/// Every share at every number of points. Fills in what was not given.
Result<std::vector<Setting>> choose_settings(EvalCommandOptions& options) {
  const auto origin = origin_of(options);
  if (!origin) return tl::unexpected(origin.error());
  if (!options.pairs.empty()) return settings_of_pairs(options);
  if (!options.protocol && *origin == generate::PairOrigin::cropped) options.protocol = Protocol::opposed;
  if (!options.protocol && !options.shares.empty()) return wrong("--share needs a --protocol");
  if (options.shares.empty()) options.shares = {0.7};
  if (options.points.empty()) options.points = {1024};
  std::vector<Setting> settings;
  for (const std::uint64_t points : options.points) {
    if (!options.protocol) {
      const bool copied = *origin == generate::PairOrigin::copied;
      settings.push_back({copied ? "copy" : "break", {}, options.keep.value_or(copied ? 0.8 : seam), points});
      continue;
    }
    for (const double share : options.shares)
      settings.push_back({std::string(name(*options.protocol)), share,
                          options.keep.value_or(usual_keep(*options.protocol, share)), points});
  }
  return settings;
}

std::vector<OutputFile> outputs(const EvalCommandOptions& options) {
  return {{"--csv", options.csv, "a table of pairs"},
          {"--html", options.html, "a page"},
          {"--json", options.json}};
}

Result<void> check_options(const EvalCommandOptions& options) {
  if (options.keep && !(*options.keep > 0 && *options.keep <= 1))
    return wrong("--keep " + Json(*options.keep).dump() + ": is not above 0 and up to 1");
  if (const auto checked = check_answers(options.answers()); !checked) return checked;
  for (const double share : options.shares)
    if (!(share > 0 && share <= 1))
      return wrong("--share " + Json(share).dump() + ": is not above 0 and up to 1");
  for (const std::uint64_t points : options.points)
    if (points < 2 || points > max_generated_points)
      return wrong("--points " + std::to_string(points) + ": is not in 2 … " +
                   std::to_string(max_generated_points));
  std::vector<std::string> inputs = options.methods.models;
  inputs.push_back(options.pairs);
  return check_outputs(outputs(options), inputs);
}

/// What is found out once they are listed.
Result<void> check_not_read(const EvalCommandOptions& options, const InputFiles& files) {
  for (const OutputFile& output : outputs(options))
    if (!output.path.empty() && files.has(output.path))
      return wrong(std::string(output.option) + " " + output.path + ": would replace an input");
  return {};
}

/// Pairs that are made of shapes, or those of a manifest.
class EvalData {
 public:
  explicit EvalData(DataSet shapes) : shapes_(std::move(shapes)) {}
  EvalData(std::shared_ptr<const PairList> list, std::size_t points, std::uint64_t seed)
      : list_(std::move(list)), points_(points), seed_(seed) {}

  Result<DataSample> sample(std::size_t i) const {
    return list_ ? list_->sample(i, points_, seed_) : shapes_->sample(0, i);
  }
  std::size_t shapes() const { return list_ ? list_->pairs() : shapes_->shapes(); }
  std::vector<SkippedShape> skipped() const {
    return list_ ? std::vector<SkippedShape>() : shapes_->skipped();
  }

 private:
  std::optional<DataSet> shapes_;
  std::shared_ptr<const PairList> list_;
  std::size_t points_ = 0;
  std::uint64_t seed_ = 0;
};

Result<DataSet> open_data(const EvalCommandOptions& options, const Setting& setting, bool normals) {
  DataOptions data;
  DataPart part;
  part.kind = options.kind;
  part.shapes = options.shapes;
  part.folder = options.folder;
  part.protocol = options.protocol;
  if (setting.share) part.share_low = part.share_high = *setting.share;
  data.parts = {part};
  data.split = options.split;
  data.points_low = data.points_high = setting.points;
  data.noise = options.noise;
  data.normals = normals;
  data.same_points = options.same_points;
  data.samples = options.samples;
  data.seed = options.seed;
  return DataSet::open(data);
}

// A folder of a few shapes has not been divided for training either (ShapeSplit::automatic).
void choose_split(EvalCommandOptions& options, const Setting& setting, bool normals) {
  options.split = options.asked_split.value_or(Split::test);
  if (options.asked_split || options.folder.empty()) return;
  EvalCommandOptions whole = options;
  whole.split = Split::all;
  const auto all = open_data(whole, setting, normals);
  if (!all || all->shapes() >= least_divided_shapes) return;
  options.split = Split::all;
  warn("--data " + options.folder + ": " + std::to_string(all->shapes()) +
       (all->shapes() == 1 ? " shape is" : " shapes are") +
       " too few to hold some back: a model trained on this folder has seen them");
}

Result<std::vector<DataSample>> draw(const EvalData& data, std::size_t first, std::size_t count,
                                     const Device& device) {
  std::vector<Result<DataSample>> drawn(count, fail(ErrorCode::internal, "not drawn"));
  Internal::pool(device).parallel_for(count, 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) drawn[i] = data.sample(first + i);
  });
  std::vector<DataSample> batch;
  for (Result<DataSample>& sample : drawn) {
    if (!sample) return tl::unexpected(sample.error());
    batch.push_back(std::move(*sample));
  }
  return batch;
}

void add_once(std::vector<Follow>& list, Follow follow) {
  if (std::find(list.begin(), list.end(), follow) == list.end()) list.push_back(follow);
}

Result<void> record(EvalMethod& rows, std::span<const DataSample> batch, const std::vector<Pose>& poses,
                    const Estimate& estimate, std::size_t first, const Estimation& how, bool judge) {
  std::vector<Confidence> judged = estimate.confidences;
  if (judge && judged.empty()) {
    auto found = judge_poses(how.device, pairs_of(batch), poses, estimate.evidence);
    if (!found) return tl::unexpected(found.error());
    judged = std::move(*found);
  }
  for (std::size_t i = 0; i < batch.size(); ++i) {
    rows.pairs.push_back(
        {batch[i].shape, first + i, batch[i].overlap, errors_of(poses[i], batch[i]), poses[i]});
    if (judge) rows.pairs.back().confidence = std::move(judged[i]);
  }
  return {};
}

Result<EvalSetting> evaluate(const EvalCommandOptions& options, const Setting& setting, const EvalData& data,
                             std::vector<Method>& methods, const Device& device) {
  EvalSetting result{.protocol = setting.protocol,
                     .share = setting.share,
                     .points = setting.points,
                     .keep = setting.keep,
                     .by_overlap = options.protocol == Protocol::independent,
                     .methods = {}};
  for (const Method& method : methods) {
    if (method.plain) result.methods.push_back({method.name, {}});
    for (const Follow follow : method.refined)
      result.methods.push_back({method.name + "+" + std::string(name(follow)), {}});
  }
  const Estimation how{device, options.methods.mode, setting.keep, options.answers()};
  for (std::size_t first = 0; first < options.samples; first += options.batch) {
    const auto batch =
        draw(data, first, std::min<std::size_t>(options.batch, options.samples - first), device);
    if (!batch) return tl::unexpected(batch.error());
    std::size_t row = 0;
    const auto failed = [&](const Error& error, const std::string& name) {
      return fail(error.code, name + ", samples from " + std::to_string(first) + " on: " + error.message);
    };
    for (Method& method : methods) {
      const Stopwatch estimating;
      const auto found = estimate(method, *batch, how);
      const double estimated = estimating.milliseconds() - (found ? found->beside_milliseconds : 0);
      if (!found) return failed(found.error(), method.name);
      const auto add = [&](const std::vector<Pose>& poses, double milliseconds) {
        result.methods[row].milliseconds += milliseconds;
        return record(result.methods[row++], *batch, poses, *found, first, how, options.confidence);
      };
      if (method.plain)
        if (const auto added = add(found->poses, estimated); !added)
          return failed(added.error(), method.name);
      for (const Follow follow : method.refined) {
        const std::string& name = result.methods[row].name;
        const Stopwatch refining;
        const auto better = refined(found->poses, follow, *batch, how);
        const double milliseconds = estimated + refining.milliseconds();
        if (!better) return failed(better.error(), name);
        if (const auto added = add(*better, milliseconds); !added) return failed(added.error(), name);
      }
    }
    show_progress(setting.protocol + (setting.share ? ", s = " + Json(*setting.share).dump() : "") + ", " +
                  std::to_string(setting.points) + " points: " + std::to_string(first + batch->size()) +
                  " of " + std::to_string(options.samples));
  }
  return result;
}

Json about(const EvalCommandOptions& options, const std::vector<Method>& methods, const Device& device,
           std::size_t shapes) {
  Json models = Json::array();
  for (const Method& method : methods)
    if (method.model && !method.file.empty())
      models.push_back({{"method", method.name},
                        {"file", method.file},
                        {"parameters", method.model->parameter_count()},
                        {"trained", method.model->trained()},
                        {"mode", mode_name(options.methods.mode.value_or(method.model->mode()))}});
  Json json;
  if (!options.pairs.empty())
    json = {{"pairs", options.pairs}, {"held", shapes}};
  else
    json = {{options.kind.empty() ? "data" : "kind", options.kind.empty() ? options.folder : options.kind},
            {"split", split_name(options.split)},
            {"shapes", shapes},
            {"noise", options.noise},
            {"same_points", options.same_points}};
  json.update({{"samples", options.samples},
               {"seed", options.seed},
               {"answers", options.answers()},
               {"models", models},
               {"backend", name(device.backend())},
               {"device", device.name()}});
  return json;
}

/// Shapes and pairs are made again, so that none had to be kept.
Result<std::string> page_of(const EvalReport& report, const std::vector<EvalData>& data) {
  std::vector<EvalCase> cases = worst_and_best(report);
  for (EvalCase& one : cases) {
    const EvalPair& pair = report.settings[one.setting].methods[one.method].pairs[one.pair];
    if (!is_finite(pair.T_reference_source)) continue;
    const auto sample = data[one.setting].sample(pair.sample);
    if (!sample) return tl::unexpected(sample.error());
    Assembly assembly;
    assembly.T_reference_source = pair.T_reference_source;
    const auto image =
        render_picture(sample->source, sample->reference, assembly, {.width = 960, .height = 260});
    if (!image) return tl::unexpected(image.error());
    auto png = encode_png(*image);
    if (!png) return tl::unexpected(png.error());
    one.png = std::move(*png);
  }
  return to_html(report, cases);
}

std::string describe(const EvalCommandOptions& options, std::size_t shapes) {
  if (!options.pairs.empty())
    return options.pairs + ", " + std::to_string(shapes) + (shapes == 1 ? " pair" : " pairs") +
           ", both clouds moved at random, seed " + std::to_string(options.seed);
  return (options.kind.empty() ? options.folder : options.kind) + ", " + split_name(options.split) +
         " split of " + std::to_string(shapes) + (shapes == 1 ? " shape" : " shapes") + ", noise " +
         Json(options.noise).dump() + ", seed " + std::to_string(options.seed) +
         (options.same_points ? ", the same points in both clouds" : "") +
         (options.protocol ? "; points are counted before the crop" : "");
}

int run(EvalCommandOptions& options) {
  if (const auto checked = check_options(options); !checked) return complain(checked.error());
  const auto settings = choose_settings(options);
  if (!settings) return complain(settings.error());
  set_at_hand(std::to_string(options.batch) + " pairs of " +
              std::to_string(*std::max_element(options.points.begin(), options.points.end())) +
              " points at once");
  auto methods = choose_methods(options.methods);
  if (!methods) return complain(methods.error());

  const bool normals = std::any_of(methods->begin(), methods->end(), [](const Method& method) {
    return method.model && method.model->config().return_normals;
  });
  const bool solving = std::any_of(methods->begin(), methods->end(),
                                   [](const Method& method) { return method.kind == MethodKind::solve; });
  // solve() takes normals where there are some: generated shapes have them for the asking.
  const bool with_normals = normals || (solving && !options.kind.empty());
  std::shared_ptr<const PairList> list;
  if (!options.pairs.empty()) {
    auto opened = PairList::open(options.pairs);
    if (!opened) return complain(opened.error());
    if (normals && !opened->without_normals().empty())
      return complain(bad_usage, "--pairs " + options.pairs + ": " + opened->without_normals() +
                                     " has no normals, which a model reads");
    if (const auto checked = check_not_read(options, opened->files()); !checked)
      return complain(checked.error());
    if (options.samples == 0) options.samples = opened->pairs();
    list = std::make_shared<const PairList>(std::move(*opened));
  } else {
    if (!options.folder.empty()) {
      const auto shapes = shape_files(options.folder);
      if (!shapes) return complain(shapes.error());
      if (const auto checked = check_not_read(options, *shapes); !checked) return complain(checked.error());
    }
    if (options.samples == 0) options.samples = 200;
    choose_split(options, settings->front(), normals);
  }
  // All opened before any is used: what is wrong with one should not come out after an hour.
  std::vector<EvalData> data;
  for (const Setting& setting : *settings) {
    if (list) {
      data.emplace_back(list, setting.points, options.seed);
      continue;
    }
    auto opened = open_data(options, setting, with_normals);
    if (!opened) return complain(opened.error());
    data.emplace_back(std::move(*opened));
  }
  const bool network = std::any_of(methods->begin(), methods->end(),
                                   [](const Method& method) { return method.kind == MethodKind::network; });
  const auto device = open_device(options.device, !network && !solving);
  if (!device) return complain(device.error());

  EvalReport report{.data = describe(options, data[0].shapes()),
                    .about = about(options, *methods, **device, data[0].shapes()),
                    .settings = {},
                    .skipped = {}};
  for (std::size_t i = 0; i < settings->size(); ++i) {
    auto result = evaluate(options, (*settings)[i], data[i], *methods, **device);
    if (!result) return complain(result.error());
    report.settings.push_back(std::move(*result));
    for (SkippedShape& skipped : data[i].skipped())
      if (std::none_of(report.skipped.begin(), report.skipped.end(),
                       [&](const SkippedShape& known) { return known.shape == skipped.shape; }))
        report.skipped.push_back(std::move(skipped));
  }
  device->save_cache();
  clear_progress();

  print(report, options.json == "-" ? stderr : stdout);
  if (!report.skipped.empty())
    warn(std::to_string(report.skipped.size()) +
         (report.skipped.size() == 1 ? " shape was" : " shapes were") + " skipped; " +
         report.skipped[0].shape + ": " + report.skipped[0].reason);
  std::string page;
  if (!options.html.empty()) {
    auto drawn = page_of(report, data);
    if (!drawn) return complain(run_failed, drawn.error().message);
    page = std::move(*drawn);
  }
  const auto written =
      write_files({{options.csv, [&](const std::string&) { return bytes_of(to_csv(report)); }},
                   {options.html, [&](const std::string&) { return bytes_of(page); }},
                   json_writer(options.json, to_json(report))});
  return written ? done : complain(written.error());
}

}  // namespace

Command add_eval(CLI::App& root) {
  auto options = std::make_shared<EvalCommandOptions>();
  CLI::App* app = add_command(root, "eval", "Measure how far models and methods are from the truth");
  app->add_option("MODEL", options->methods.models, "Weights (.safetensors), any number of them")
      ->type_name("FILE");
  app->add_option("--kind", options->kind, "Generated shapes: a KIND of bitr generate")->type_name("KIND");
  app->add_option("--data", options->folder, "Meshes and clouds in this folder and below instead")
      ->type_name("DIR");
  auto* pairs =
      app->add_option(
             "--pairs", options->pairs,
             "Pairs with known answers instead, all in memory: a manifest of bitr batch whose pairs have a "
             "truth")
          ->type_name("MANIFEST");
  app->add_option("--methods", options->methods.controls,
                  "Controls: " + std::string(control_names) +
                      ", each also with +icp, +ot or +trimmed-icp; all of them when no model is given")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->type_name("NAME,…");
  app->add_option_function<std::vector<std::string>>(
         "--refine",
         [options](const std::vector<std::string>& names) {
           for (const std::string& text : names) {
             const auto* known = std::find_if(std::begin(follows), std::end(follows),
                                              [&](const FollowName& f) { return f.name == text; });
             if (known == std::end(follows))
               throw CLI::ValidationError("--refine", "\"" + text + "\" is not one of icp, ot, trimmed-icp");
             add_once(options->methods.refined, known->follow);
           }
         },
         "Also rows of every model followed by refinements: icp, ot, trimmed-icp")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->type_name("NAME,…");
  app->add_flag_callback(
      "--icp", [options] { add_once(options->methods.refined, Follow::icp); }, "The same as --refine icp");
  add_answers(*app, options->asked_answers, std::to_string(usual_answers));
  app->add_flag("--confidence", options->confidence,
                "Also judge every pose, and say how well that told right from wrong");
  app->add_option(
         "--keep", options->keep,
         "Share of the points that pca-icp and trimmed-icp keep; by the protocol unless given, see below")
      ->type_name("SHARE");
  const std::string explained =
      add_protocol(*app, options->protocol,
                   "Crop the whole object in two, see below; the kind's own way unless given, opposed "
                   "for files");
  app->add_option("--share", options->shares, "Shares S that a crop keeps, each evaluated on its own")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->type_name("S,…")
      ->default_str("0.7");
  app->add_option(
         "--points", options->points,
         "Points of each cloud; of the whole object where it is cropped; each number is evaluated on "
         "its own")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->type_name("N,…")
      ->default_str("1024");
  app->add_option("--noise", options->noise,
                  "Standard deviation added to every coordinate, clipped at 5 times that")
      ->type_name("LENGTH")
      ->capture_default_str();
  app->add_flag("--same-points", options->same_points,
                "Both crops take their points from one sample of the surface, not each from its own");
  add_count(*app, "--samples", options->samples, 1, 1'000'000,
            "Pairs of every share and number of points; of a manifest, its pairs again and again, moved anew")
      ->default_str("200, or the manifest's pairs");
  add_choice<Split>(
      *app, "--split", split_names, options->asked_split,
      "Shapes to use; all of a folder that has fewer than " + std::to_string(least_divided_shapes))
      ->default_str("test");
  add_count(*app, "--shapes", options->shapes, 1, 10'000'000, "Shapes of a kind, before they are split");
  add_seed(*app, "--seed", options->seed, "Seed of the pairs");
  add_count(*app, "--batch", options->batch, 1, 4096, "Pairs that the network takes at once");
  add_mode(*app, options->methods.mode,
           "Norms without their eps (scale-exact) or with it (reference); the models' own unless given");
  add_device_options(*app, options->device);
  add_json(*app, options->json);
  app->add_option("--csv", options->csv, "Write one line for every pair and method")->type_name("FILE");
  app->add_option("--html", options->html,
                  "Write a page with the table, charts, and the worst and best pairs")
      ->type_name("FILE");
  for (const char* of_shapes :
       {"--kind", "--data", "--protocol", "--share", "--noise", "--same-points", "--split", "--shapes"})
    pairs->excludes(app->get_option(of_shapes));
  app->footer(
      "Errors: Δr is the angle between the rotations, up to the shape's rotational symmetry; Δt is how far\n"
      "the object's centre ends from its place. Success is Δr ≤ 5° with Δt ≤ 0.1 of the object's diagonal,\n"
      "and 15° with 0.3; a flip is Δr > 135°.\n"
      "Controls: solve is bitr assemble without a model; identity moves nothing; complete-match takes the\n"
      "untrained network for copies; pca-icp joins centroids and principal axes in four ways, follows each "
      "with ICP, and takes the best fit.\n"
      "icp and ot refine as bitr refine --protocol default does, trimmed-icp is plain ICP on positions. It\n"
      "and pca-icp keep (2S - 1)/S of the points for opposed crops, but at least 0.2; 0.5 for independent\n"
      "ones, 0.8 for copies, 0.2 otherwise.\n"
      "Protocols:\n" +
      explained +
      "Exit status: 0 done; 1 a device or the work failed; 2 bad input or usage.\n"
      "\nExamples:\n"
      "  bitr eval --kind aircraft --share 0.7,0.5 --points 512 --samples 50\n"
      "  bitr eval model.safetensors --icp --methods identity,pca-icp --kind vessels --json errors.json\n"
      "  bitr eval aircraft --pairs scans.csv --refine icp --confidence --html scans.html\n"
      "  bitr eval a.safetensors b.safetensors --data meshes --split all --csv pairs.csv");
  return {app, [options] { return run(*options); }};
}

}  // namespace bitr::tool
