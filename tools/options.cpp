#include "options.hpp"

#include <CLI/CLI.hpp>
#include <bitr/io.hpp>
#include <charconv>
#include <cmath>
#include <limits>

#include "io/lines.hpp"

namespace bitr::tool {
namespace {

std::uint64_t parse_count(const std::string& name, const std::string& text, std::uint64_t low,
                          std::uint64_t high) {
  std::uint64_t value = 0;
  const char* end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, value);
  if (error != std::errc() || stop != end || value < low || value > high)
    throw CLI::ValidationError(name, "\"" + text + "\" is not a whole number in " + std::to_string(low) +
                                         " … " + std::to_string(high));
  return value;
}

template <class Value>
CLI::Option* count_option(CLI::App& app, const std::string& name, Value& value, std::uint64_t low,
                          std::uint64_t high, const std::string& description) {
  return app
      .add_option_function<std::string>(
          name,
          [name, &value, low, high](const std::string& text) { value = parse_count(name, text, low, high); },
          description)
      ->type_name("N");
}

}  // namespace

Result<void> needs_network(const std::string& option) {
  return fail(ErrorCode::invalid_argument,
              option + ": is about one network; name it by --model, or use --complete-match");
}

CLI::App* add_command(CLI::App& parent, const std::string& name, const std::string& description) {
  return parent.add_subcommand(name, description);
}

bool parse_vector(const std::string& text, Vec3d& vector) {
  std::size_t at = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t end = i < 2 ? text.find(',', at) : text.size();
    if (end == std::string::npos || !io::parse_number(text.substr(at, end - at), vector[i])) return false;
    if (!(std::abs(vector[i]) <= 1e100)) return false;
    at = end + 1;
  }
  return true;
}

CLI::Option* add_vector(CLI::App& app, const std::string& name, std::optional<Vec3d>& value,
                        const std::string& description) {
  return app
      .add_option_function<std::string>(
          name,
          [name, &value](const std::string& text) {
            Vec3d vector{};
            if (!parse_vector(text, vector))
              throw CLI::ValidationError(name, "\"" + text + "\" is not three numbers such as 0,0,1.5");
            value = vector;
          },
          description)
      ->type_name("X,Y,Z");
}

CLI::Option* add_words(CLI::App& app, const std::string& name, const std::string& words,
                       std::function<bool(const std::string&)> parse, const std::string& description) {
  return app
      .add_option_function<std::string>(
          name,
          [name, words, parse = std::move(parse)](const std::string& text) {
            if (!parse(text)) throw CLI::ValidationError(name, "\"" + text + "\" is not one of " + words);
          },
          description)
      ->type_name(words);
}

CLI::Option* add_count(CLI::App& app, const std::string& name, std::uint64_t& value, std::uint64_t low,
                       std::uint64_t high, const std::string& description) {
  return count_option(app, name, value, low, high, description)->default_str(std::to_string(value));
}

CLI::Option* add_count(CLI::App& app, const std::string& name, std::optional<std::uint64_t>& value,
                       std::uint64_t low, std::uint64_t high, const std::string& description) {
  return count_option(app, name, value, low, high, description);
}

CLI::Option* add_seed(CLI::App& app, const std::string& name, std::uint64_t& value,
                      const std::string& description) {
  return add_count(app, name, value, 0, std::numeric_limits<std::uint64_t>::max(), description);
}

CLI::Option* add_mode(CLI::App& app, std::optional<Mode>& mode, const std::string& description) {
  return add_choice<Mode>(app, "--mode", {{"scale-exact", Mode::scale_exact}, {"reference", Mode::reference}},
                          mode, description);
}

std::string_view mode_name(Mode mode) { return mode == Mode::scale_exact ? "scale-exact" : "reference"; }

CLI::Option* add_model(CLI::App& app, std::string& model, const std::string& otherwise) {
  std::string names;
  for (const ShippedModel& shipped : shipped_models())
    names += (names.empty() ? "" : ", ") + std::string(shipped.name);
  return app
      .add_option("--model", model,
                  "Weights (.safetensors), or a model that ships: " + names + "; " + otherwise)
      ->type_name("FILE|NAME");
}

std::string add_protocol(CLI::App& app, std::optional<Protocol>& protocol, const std::string& description) {
  std::vector<std::pair<std::string, Protocol>> names;
  std::string explained;
  for (const ProtocolName& known : protocols()) {
    names.emplace_back(known.name, known.protocol);
    explained += "  " + std::string(known.name) + std::string(13 - known.name.size(), ' ') +
                 std::string(known.summary) + "\n";
  }
  add_choice<Protocol>(app, "--protocol", std::move(names), protocol, description);
  return explained;
}

CLI::Option* add_json(CLI::App& app, std::string& path) {
  return app.add_option("--json", path, "Write the result as JSON to FILE, or to standard output for -")
      ->type_name("FILE|-");
}

CLI::Option* add_optional_json(CLI::App& app, std::string& path) {
  return add_json(app, path)->expected(0, 1)->default_str("-");
}

void add_pose_outputs(CLI::App& app, std::string& applied, const std::string& name, std::string& pose) {
  app.add_option("--applied", applied,
                 "Write the source, moved by the pose, in its own format and with all that it has besides")
      ->type_name("FILE");
  app.add_option(name, pose, "Write the pose's 4x4 matrix as four lines of text, in full precision")
      ->type_name("FILE.txt");
}

Result<void> check_applied(const std::string& source, const std::string& applied) {
  if (applied.empty()) return {};
  auto movable = io::check_move(source, applied);
  if (!movable) movable.error().message = "--applied " + applied + ": " + movable.error().message;
  return movable;
}

void add_run_options(CLI::App& app, RunOptions& options) {
  add_device_options(app, options.device);
  add_choice<Precision>(app, "--precision", {{"f32", Precision::f32}, {"f64", Precision::f64}},
                        options.plan.precision, "Precision of the arithmetic; f64 on the CPU only")
      ->default_str("f32");
  app.add_flag("--as-defined", options.plan.as_defined,
               "Evaluate the network exactly as it is defined, nothing folded: slow, on the CPU only");
  add_choice<NeighborSearch>(app, "--neighbors",
                             {{"auto", NeighborSearch::automatic},
                              {"brute-force", NeighborSearch::brute_force},
                              {"tree", NeighborSearch::tree}},
                             options.plan.neighbors,
                             "How a point's neighbours are looked for, by the cloud's size unless given; "
                             "the result is the same")
      ->default_str("auto");
  app.add_option("--profile", options.profile,
                 "Write when each operation ran, as a trace for ui.perfetto.dev or chrome://tracing")
      ->type_name("FILE.trace.json");
}

Result<void> check_solvable(const RunOptions& options) {
  const PlanOptions usual;
  const std::pair<const char*, bool> asked[] = {{"--precision", options.plan.precision != usual.precision},
                                                {"--as-defined", options.plan.as_defined},
                                                {"--mode", options.plan.mode.has_value()},
                                                {"--neighbors", options.plan.neighbors != usual.neighbors},
                                                {"--profile", !options.profile.empty()}};
  for (const auto& [option, given] : asked)
    if (given) return needs_network(option);
  return {};
}

Result<OpenDevice> open_device(const RunOptions& options) {
  return open_device(options.device, options.plan.precision == Precision::f64 || options.plan.as_defined);
}

OutputFile profile_output(const RunOptions& options) { return {"--profile", options.profile, "a trace"}; }

FileWriter profile_writer(const RunOptions& options, const Plan& plan) {
  return {options.profile, [&plan](const std::string&) { return bytes_of(chrome_trace(plan)); }};
}

std::string_view precision_name(Precision precision) { return precision == Precision::f64 ? "f64" : "f32"; }

}  // namespace bitr::tool
