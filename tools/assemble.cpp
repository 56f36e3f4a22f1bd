// bitr assemble: one pair of clouds, its pose.
#include <CLI/CLI.hpp>
#include <bitr/assemble.hpp>
#include <bitr/io.hpp>
#include <bitr/view.hpp>
#include <filesystem>
#include <memory>

#include "answer.hpp"
#include "assembly_report.hpp"
#include "cloud_input.hpp"
#include "command.hpp"
#include "device_choice.hpp"
#include "io/formats.hpp"
#include "joined_cloud.hpp"
#include "options.hpp"
#include "output.hpp"
#include "pose_file.hpp"
#include "solve_run.hpp"
#include "stopwatch.hpp"

namespace bitr::tool {
namespace {

struct Options {
  std::string source, reference, output, applied, pose, image, view, json, truth;
  bool verify = false, solve = false;
  ModelChoice model;
  CloudOptions clouds;
  AnswerChoice answer;
  RunOptions run;
};

// The default model cannot read clouds without normals.
Result<Model> choose_model(Options& options, const CloudInput& source, const CloudInput& reference) {
  auto model = tool::choose_model(options.model);
  if (!model || !options.model.model.empty() || options.model.complete_match) return model;
  const bool normals = !source.cloud.normals.empty() && !reference.cloud.normals.empty();
  if (normals || !model->config().return_normals) return model;
  warn("the default model reads normals, and " + (source.cloud.normals.empty() ? source : reference).path +
       " has none: falling back to complete matching with untrained weights, which is exact when the "
       "reference is a moved copy of the source and has no answer otherwise");
  options.model.complete_match = true;
  return tool::choose_model(options.model);
}

void warn_of_few_points(const CloudInput& input, const Model& model) {
  if (!too_few_points(input, model)) return;
  const PointRange known = *model.trained_points();
  warn(input.path + " has " + std::to_string(input.used.size()) + " points; model " + model.name() +
       " was trained on clouds of " + std::to_string(known.low) + " to " + std::to_string(known.high));
}

Result<void> check_own_outputs(const Options& options) {
  if (!options.view.empty() && !has_view())
    return fail(ErrorCode::unsupported,
                "--view " + options.view +
                    ": this build has no view; run tools/install_packages.sh, configure and build again");
  return tool::check_outputs({{"--output", options.output, "a cloud"},
                              {"--applied", options.applied, "a cloud"},
                              {"--pose", options.pose, "a pose"},
                              {"--json", options.json},
                              {"--image", options.image, "a picture"},
                              {"--view", options.view, "a page"},
                              profile_output(options.run)},
                             {options.source, options.reference, options.model.model, options.truth});
}

/// What the page does not show in another way, and nothing that differs from run to run.
std::string view_report(const AssemblyReport& report) {
  Json json = to_json(report);
  for (const char* key : {"rotation", "translation", "key_points", "timing_ms"}) json.erase(key);
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

Result<void> write_outputs(const Options& options, const CloudInput& source, const CloudInput& reference,
                           const AssemblyReport& report) {
  const Assembly& assembly = report.answer.assembly;
  const auto cloud = [&](const std::string& path) {
    return io::ply_file(path, joined_cloud(source.cloud, reference.cloud, assembly.T_reference_source));
  };
  const auto image = [&](const std::string&) { return picture_of(source.cloud, reference.cloud, assembly); };
  const auto view = [&](const std::string&) {
    return render_view(source.cloud, reference.cloud, assembly,
                       {.source_name = std::filesystem::path(source.path).filename(),
                        .reference_name = std::filesystem::path(reference.path).filename(),
                        .report = view_report(report)})
        .map(bytes_of);
  };
  const auto applied = [&](const std::string& path) {
    return io::moved_file(options.source, path, assembly.T_reference_source);
  };
  return write_files({{options.output, cloud},
                      {options.applied, applied},
                      pose_writer(options.pose, assembly.T_reference_source),
                      {options.image, image},
                      {options.view, view},
                      profile_writer(options.run, report.plan),
                      json_writer(options.json, to_json(report))});
}

int run(Options& options) {
  if (const auto checked = check_own_outputs(options); !checked) return complain(checked.error());
  if (const auto checked = check_applied(options.source, options.applied); !checked)
    return complain(checked.error());
  if (options.solve) {
    SolveRun run{options.source,
                 options.reference,
                 options.output,
                 options.applied,
                 options.pose,
                 options.image,
                 options.json,
                 options.truth,
                 options.clouds,
                 options.run.device,
                 {}};
    if (options.answer.strict) run.least_confidence = options.answer.least_confidence;
    return run_solve(run);
  }
  auto how = answer_options(options.answer);
  if (!how) return complain(how.error());
  how->swap_residual = true;
  const auto truth = read_optional_pose(options.truth);
  if (!truth) return complain(truth.error());

  set_at_hand("source " + options.source + ", reference " + options.reference);
  show_progress("reading");
  const Stopwatch total;
  auto source = read_input(options.source, options.clouds);
  if (!source) return complain(source.error());
  auto reference = read_input(options.reference, options.clouds);
  if (!reference) return complain(reference.error());
  const auto model = choose_model(options, *source, *reference);
  if (!model) return complain(model.error());
  how->complete_match = options.model.complete_match;
  for (CloudInput* input : {&*source, &*reference}) {
    choose_points(*input, options.clouds, *model);
    warn_of_few_points(*input, *model);
  }

  show_progress("assembling");
  const std::string which = at_hand();
  set_at_hand("source " + described(*source) + ", reference " + described(*reference));
  const CloudPair pair = {source->used, reference->used};
  const auto device = open_device(options.run);
  if (!device) return complain(device.error());
  auto plan = make_plan(**device, *model, shape_of({&pair, 1}), options.run.plan);
  if (!plan) return complain(plan.error(), which);
  const InputPair input = {*source, *reference};
  auto answers = answer(*plan, {&input, 1}, *how);
  if (!answers) return complain(answers.error(), which);
  device->save_cache();

  AssemblyReport report{.answer = std::move(answers->front()),
                        .plan = *plan,
                        .complete_match = options.model.complete_match,
                        .source_points = source->used.size(),
                        .reference_points = reference->used.size(),
                        .timings = plan->timings(),
                        .truth = *truth,
                        .refine_options = how->refine.value_or(RefineOptions())};
  report.total_milliseconds = total.milliseconds();
  if (options.verify) {
    show_progress("verifying");
    auto differences = verify(*plan, pair);
    if (!differences) return complain(differences.error(), which);
    report.verification = std::move(*differences);
  }
  clear_progress();

  // With JSON on standard output, text for people goes to standard error.
  print(report, options.json == "-" ? stderr : stdout);
  const Assembly& assembly = report.answer.assembly;
  if (assembly.status == Status::failed)
    return complain(run_failed, which + "a number is not finite; nothing was written");
  if (!within_bounds(report))
    return complain(run_failed,
                    which + "the verification found a stage beyond its bound; nothing was written");
  if (const std::string why = refusal(report.answer, options.answer); !why.empty())
    return complain(run_failed, which + why + "; nothing was written");
  if (assembly.status == Status::degenerate)
    warn(which + "the pose is not determined: " + assembly.diagnostics.reason);
  if (options.model.complete_match && !report.answer.restricted &&
      assembly.diagnostics.overlap.value_or(1) < 0.9)
    warn(which +
         "the pose leaves much of the source off the reference, so this is no moved copy and complete "
         "matching has no answer for it");
  const auto written = write_outputs(options, *source, *reference, report);
  return written ? done : complain(written.error());
}

}  // namespace

Command add_assemble(CLI::App& root) {
  auto options = std::make_shared<Options>();
  CLI::App* app = add_command(root, "assemble", "Find the pose that assembles a source with a reference");
  app->add_option("SOURCE", options->source, "Cloud or mesh to be moved")->required()->type_name("FILE");
  app->add_option("REFERENCE", options->reference, "Cloud or mesh that stays")->required()->type_name("FILE");
  app->add_option("-o,--output", options->output, "Write both clouds, assembled, to this PLY file")
      ->type_name("FILE");
  add_pose_outputs(*app, options->applied, "--pose,--pose-out", options->pose);
  app->add_option("--image", options->image, "Draw both clouds, before and after, to this PNG file")
      ->type_name("FILE");
  app->add_option("--view", options->view, "Write a page with both clouds in 3-D, to be opened in a browser")
      ->type_name("FILE");
  add_json(*app, options->json);
  add_model_options(*app, options->model, options->run.plan.mode);
  add_cloud_options(*app, options->clouds);
  add_run_options(*app, options->run);
  add_answer_options(*app, options->answer, true);
  app->add_option("--truth", options->truth, "Compare with the true pose in this JSON file")
      ->type_name("FILE");
  app->add_flag("--verify", options->verify,
                "Also evaluate the pair as defined in double precision and compare every stage");
  app->add_flag(
         "--solve", options->solve,
         "By the clouds' geometry instead of a network: for clouds that overlap, with or without normals")
      ->excludes("--model", "--verify", "--view", "--refine", "--translation-only", "--yaw-only", "--answers",
                 "--no-confidence", "--complete-match");
  app->footer(
      "Clouds: PLY, PCD, XYZ, TXT, CSV, NPY. Meshes, which are sampled: OBJ, OFF, STL, PLY with faces.\n"
      "The pose is T_reference_source, in the clouds' units: x_reference = R x_source + t.\n"
      "Restricted, it has the rotation R' of its family that is nearest to the network's R (Frobenius norm;\n"
      "the identity for a shift), and t' = R c + t - R' c: the source's centroid c goes where it went.\n"
      "Refinement starts there, and is restricted like it before its fit is compared with the start's.\n"
      "Exit status: 0 done; 1 ran, but the result is not to be used; 2 bad input or usage.\n\n"
      "Examples:\n"
      "  bitr assemble piece.ply other_piece.ply -o assembled.ply --json result.json\n"
      "  bitr assemble nose.ply tail.ply --model aircraft --refine=icp -o assembled.ply\n"
      "  bitr assemble scan.pcd map.pcd --yaw-only=z --applied moved.pcd --pose pose.txt\n"
      "  bitr assemble scan.ply moved.ply --complete-match --json -");
  return {app, [options] { return run(*options); }};
}

}  // namespace bitr::tool
