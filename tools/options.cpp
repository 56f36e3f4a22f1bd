#include "options.hpp"

#include <charconv>
#include <limits>

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

CLI::Option* add_json(CLI::App& app, std::string& path) {
  return app.add_option("--json", path, "Write the result as JSON to FILE, or to standard output for -")
      ->type_name("FILE|-");
}

void add_run_options(CLI::App& app, RunOptions& options) {
  const auto backend = [](const std::string& text) {
    if (text == "auto" || text == "cpu") return;
    throw CLI::ValidationError("--backend", text == "vulkan"
                                                ? "vulkan is unsupported in this build, which has cpu only"
                                                : "\"" + text + "\" is not one of auto|cpu");
  };
  app.add_option_function<std::string>("--backend", backend, "Where to run")
      ->type_name("auto|cpu")
      ->default_str("auto");
  add_count(app, "--threads", options.threads, 0, 4096,
            "CPU threads, 0 for every core; results do not depend on them");
  add_choice<Precision>(app, "--precision", {{"f32", Precision::f32}, {"f64", Precision::f64}},
                        options.plan.precision, "Precision of the arithmetic")
      ->default_str("f32");
  app.add_flag("--as-defined", options.plan.as_defined,
               "Evaluate the network exactly as it is defined, nothing folded: slow");
}

std::string_view precision_name(Precision precision) { return precision == Precision::f64 ? "f64" : "f32"; }

}  // namespace bitr::tool
