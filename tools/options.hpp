// Options that several commands share, and values read strictly: a whole number is digits and nothing else.
#pragma once

#include <bitr/assemble.hpp>
#include <bitr/cloud.hpp>
#include <bitr/generate.hpp>
#include <bitr/model.hpp>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "cli.hpp"
#include "device_choice.hpp"
#include "output.hpp"

namespace bitr::tool {

inline constexpr std::uint64_t most_points = 100'000'000;

/// A command below `parent`, for which an app is made. One unit makes them all: what the parser's constructor needs is half of
/// the parser.
CLI::App* add_command(CLI::App& parent, const std::string& name, const std::string& description);

/// A whole number in low … high; the error names the option, the value and the range.
CLI::Option* add_count(CLI::App& app, const std::string& name, std::uint64_t& value, std::uint64_t low,
                       std::uint64_t high, const std::string& description);
CLI::Option* add_count(CLI::App& app, const std::string& name, std::optional<std::uint64_t>& value,
                       std::uint64_t low, std::uint64_t high, const std::string& description);
CLI::Option* add_seed(CLI::App& app, const std::string& name, std::uint64_t& value,
                      const std::string& description);

/// Three numbers with commas between them, none beyond 1e100; false for anything else.
bool parse_vector(const std::string& text, Vec3d& vector);
CLI::Option* add_vector(CLI::App& app, const std::string& name, std::optional<Vec3d>& value,
                        const std::string& description);

/// An option with a fixed set of words, shown with | between them; `parse` says whether it knows the one given.
CLI::Option* add_words(CLI::App& app, const std::string& name, const std::string& words,
                       std::function<bool(const std::string&)> parse, const std::string& description);

/// An option with a fixed set of words, each standing for a value.
template <class Value, class Target>
CLI::Option* add_choice(CLI::App& app, const std::string& name,
                        std::vector<std::pair<std::string, Value>> choices, Target& target,
                        const std::string& description) {
  std::string words;
  for (const auto& [word, value] : choices) words += (words.empty() ? "" : "|") + word;
  const auto parse = [choices = std::move(choices), &target](const std::string& text) {
    for (const auto& [word, value] : choices)
      if (word == text) return target = value, true;
    return false;
  };
  return add_words(app, name, words, parse, description);
}

/// --mode scale-exact|reference
CLI::Option* add_mode(CLI::App& app, std::optional<Mode>& mode, const std::string& description);
std::string_view mode_name(Mode mode);

CLI::Option* add_json(CLI::App& app, std::string& path);

/// --json with or without a file; "-" without.
CLI::Option* add_optional_json(CLI::App& app, std::string& path);

/// --applied, and a file of the 4×4 matrix under the given name.
void add_pose_outputs(CLI::App& app, std::string& applied, const std::string& name, std::string& pose);
/// Whether the source can be moved as --applied asks.
Result<void> check_applied(const std::string& source, const std::string& applied);

/// --model FILE|NAME, for find_model().
CLI::Option* add_model(CLI::App& app, std::string& model, const std::string& otherwise);
/// --protocol; returns a line for each, for the help's end.
std::string add_protocol(CLI::App& app, std::optional<Protocol>& protocol, const std::string& description);

/// How a plan runs: where (device_choice.hpp), --precision, --as-defined, --profile.
struct RunOptions {
  DeviceChoice device;
  PlanOptions plan;
  std::string profile;
};
void add_run_options(CLI::App& app, RunOptions& options);
/// Of an option that is given where no network is named: `invalid_argument`.
Result<void> needs_network(const std::string& option);
/// `invalid_argument` for what solve() has no use for: it is about one network.
Result<void> check_solvable(const RunOptions& options);
Result<OpenDevice> open_device(const RunOptions& options);
/// The file of --profile, for check_outputs.
OutputFile profile_output(const RunOptions& options);
/// The plan's last assemble(), for write_files; `plan` is to live until then.
FileWriter profile_writer(const RunOptions& options, const Plan& plan);
std::string_view precision_name(Precision precision);

}  // namespace bitr::tool
