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
#include "stopwatch.hpp"

namespace bitr::tool {
namespace {

struct Options {
  std::string source, reference, output, applied, pose, image, view, json, truth;
  bool verify = false;
  std::optional<Vec3d> viewpoint, source_viewpoint, reference_viewpoint;
  ModelChoice model;
  CloudOptions clouds;
  AnswerChoice answer;
  RunOptions run;
};

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

std::string named_pose(const SolvedPose& pose) {
  char text[32];
  std::snprintf(text, sizeof text, "%.2f, ", pose.confidence);
  return text + pose.proposal;
}

ViewOptions view_options(const CloudInput& source, const CloudInput& reference,
                         const AssemblyReport& report) {
  ViewOptions options{.source_name = std::filesystem::path(source.path).filename(),
                      .reference_name = std::filesystem::path(reference.path).filename(),
                      .report = view_report(report)};
  const auto& solution = report.answer.solution;
  if (!solution || solution->alternatives.empty()) return options;
  options.names.push_back(named_pose(solution->best));
  for (const SolvedPose& other : solution->alternatives) {
    options.alternatives.push_back(other.T_reference_source);
    options.names.push_back(named_pose(other));
  }
  return options;
}

std::optional<double> confidence_of(const Answer& answer) {
  return answer.confidence ? std::optional(answer.confidence->value) : std::nullopt;
}

Result<void> write_outputs(const Options& options, const CloudInput& source, const CloudInput& reference,
                           const AssemblyReport& report) {
  const Assembly& assembly = report.answer.assembly;
  const auto cloud = [&](const std::string& path) {
    return io::ply_file(path, joined_cloud(source.cloud, reference.cloud, assembly.T_reference_source));
  };
  const auto image = [&](const std::string&) {
    return picture_of(source.cloud, reference.cloud, assembly, confidence_of(report.answer));
  };
  const auto view = [&](const std::string&) {
    return render_view(source.cloud, reference.cloud, assembly, view_options(source, reference, report))
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
                      report.plan ? profile_writer(options.run, *report.plan) : FileWriter{},
                      json_writer(options.json, to_json(report))});
}

/// What only one network can be asked; without one there is nobody to answer.
Result<void> check_network_options(const Options& options) {
  if (names_network(options.model)) return {};
  const std::pair<const char*, bool> asked[] = {{"--verify", options.verify},
                                                {"--no-confidence", !options.answer.confidence}};
  for (const auto& [option, given] : asked)
    if (given) return needs_network(option);
  return check_solvable(options.run);
}

/// The pair's clouds, and what is to be said and written of them.
struct ReadPair {
  CloudInput source, reference;
  std::string which;  ///< as a prefix of messages
  InputPair pair() const { return {source, reference}; }
};

Result<Answer> solve_job(const ReadPair& job, const Device& device, const AnswerOptions& how) {
  show_progress("solving");
  const InputPair pair = job.pair();
  auto answers = solve_pairs(device, {&pair, 1}, how);
  if (!answers) return tl::unexpected(answers.error());
  return std::move(answers->front());
}

int finish(const Options& options, const ReadPair& job, const AssemblyReport& report) {
  clear_progress();
  // With JSON on standard output, text for people goes to standard error.
  print(report, options.json == "-" ? stderr : stdout);
  for (const CloudInput* input : {&job.source, &job.reference})
    if (input->holes > 0 && !report.answer.solution) warn_of_holes(*input);
  const Assembly& assembly = report.answer.assembly;
  if (assembly.status == Status::failed)
    return complain(run_failed, job.which + "a number is not finite; nothing was written");
  if (!within_bounds(report))
    return complain(run_failed,
                    job.which + "the verification found a stage beyond its bound; nothing was written");
  if (const std::string why = refusal(report.answer, options.answer); !why.empty())
    return complain(run_failed, job.which + why + "; nothing was written");
  if (assembly.status == Status::degenerate)
    warn(job.which + "the pose is not determined: " + assembly.diagnostics.reason);
  if (options.model.complete_match && !report.answer.restricted &&
      assembly.diagnostics.overlap.value_or(1) < 0.9)
    warn(job.which +
         "the pose leaves much of the source off the reference, so this is no moved copy and complete "
         "matching has no answer for it");
  const auto written = write_outputs(options, job.source, job.reference, report);
  return written ? done : complain(written.error());
}

int run_solve(const Options& options, ReadPair& job, const AnswerOptions& how, AssemblyReport& report,
              const Stopwatch& total) {
  for (CloudInput* input : {&job.source, &job.reference}) choose_points(*input, options.clouds);
  const auto device = open_device(options.run);
  if (!device) return complain(device.error());
  auto answer = solve_job(job, **device, how);
  if (!answer) return complain(answer.error(), job.which);
  device->save_cache();
  report.answer = std::move(*answer);
  report.device = &**device;
  report.source_points = looked_at(job.source);
  report.reference_points = looked_at(job.reference);
  report.total_milliseconds = total.milliseconds();
  return finish(options, job, report);
}

int run_network(const Options& options, ReadPair& job, AnswerOptions& how, AssemblyReport& report,
                const Stopwatch& total) {
  const auto model = choose_model(options.model);
  if (!model) return complain(model.error());
  how.complete_match = options.model.complete_match;
  how.swap_residual = true;
  for (CloudInput* input : {&job.source, &job.reference}) {
    if (const auto checked = check_normals(*input, *model); !checked) return complain(checked.error());
    choose_points(*input, options.clouds, *model);
    warn_of_few_points(*input, *model);
  }
  show_progress("assembling");
  set_at_hand("source " + described(job.source) + ", reference " + described(job.reference));
  const CloudPair pair = {job.source.used, job.reference.used};
  const auto device = open_device(options.run);
  if (!device) return complain(device.error());
  auto plan = make_plan(**device, *model, shape_of({&pair, 1}), options.run.plan);
  if (!plan) return complain(plan.error(), job.which);
  const InputPair input = job.pair();
  auto answers = answer(*plan, {&input, 1}, how);
  if (!answers) return complain(answers.error(), job.which);
  device->save_cache();
  report.answer = std::move(answers->front());
  report.plan = &*plan;
  report.device = &**device;
  report.complete_match = options.model.complete_match;
  report.source_points = job.source.used.size();
  report.reference_points = job.reference.used.size();
  report.timings = plan->timings();
  report.total_milliseconds = total.milliseconds();
  if (options.verify) {
    show_progress("verifying");
    auto differences = verify(*plan, pair);
    if (!differences) return complain(differences.error(), job.which);
    report.verification = std::move(*differences);
  }
  return finish(options, job, report);
}

int run(Options& options) {
  if (const auto checked = check_own_outputs(options); !checked) return complain(checked.error());
  if (const auto checked = check_network_options(options); !checked) return complain(checked.error());
  if (const auto checked = check_applied(options.source, options.applied); !checked)
    return complain(checked.error());
  auto how = answer_options(options.answer);
  if (!how) return complain(how.error());
  const auto truth = read_optional_pose(options.truth);
  if (!truth) return complain(truth.error());

  set_at_hand("source " + options.source + ", reference " + options.reference);
  show_progress("reading");
  const Stopwatch total;
  options.clouds.strict = options.answer.strict;
  auto source = read_input(options.source, options.clouds);
  if (!source) return complain(source.error());
  auto reference = read_input(options.reference, options.clouds);
  if (!reference) return complain(reference.error());
  if (options.viewpoint) source->viewpoint = reference->viewpoint = options.viewpoint;
  if (options.source_viewpoint) source->viewpoint = options.source_viewpoint;
  if (options.reference_viewpoint) reference->viewpoint = options.reference_viewpoint;
  ReadPair job{std::move(*source), std::move(*reference), at_hand()};
  AssemblyReport report;
  report.truth = *truth;
  report.refine_options = how->refine.value_or(RefineOptions());
  return names_network(options.model) ? run_network(options, job, *how, report, total)
                                      : run_solve(options, job, *how, report, total);
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
  add_vector(*app, "--viewpoint", options->viewpoint,
             "Where the sensor stood, in the frame of its cloud: estimated normals point there; as a PCD's "
             "VIEWPOINT, for both clouds");
  add_vector(*app, "--source-viewpoint", options->source_viewpoint, "The same for the source alone");
  add_vector(*app, "--reference-viewpoint", options->reference_viewpoint, "The same for the reference alone");
  add_run_options(*app, options->run);
  add_answer_options(*app, options->answer, true);
  app->add_option("--truth", options->truth, "Compare with the true pose in this JSON file")
      ->type_name("FILE");
  app->add_flag("--verify", options->verify,
                "Also evaluate the pair as defined in double precision and compare every stage");
  app->footer(
      "Clouds: PLY, PCD, XYZ, TXT, CSV, NPY. Meshes, which are sampled: OBJ, OFF, STL, PLY with faces.\n"
      "The pose is T_reference_source, in the clouds' units: x_reference = R x_source + t.\n"
      "Without --model, poses are proposed by the clouds' geometry and, where that leaves a doubt, by every\n"
      "model that ships; the most likely is returned, with its confidence.\n"
      "Restricted, it has the rotation R' of its family that is nearest to the pose's R (Frobenius norm;\n"
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
