// bitr model info: what a file of weights holds.
#include <CLI/CLI.hpp>
#include <bitr/model.hpp>
#include <iostream>
#include <memory>

#include "api/internal.hpp"
#include "command.hpp"
#include "io/quote.hpp"
#include "model/config.hpp"
#include "model/weights.hpp"
#include "options.hpp"
#include "output.hpp"

namespace bitr::tool {
namespace {

struct InfoOptions {
  std::string input, json;
};

int run(const InfoOptions& options) {
  if (const auto checked = check_output("--json", options.json, {options.input}); !checked)
    return complain(checked.error());
  set_at_hand(options.input);
  const auto model = find_model(options.input);
  if (!model) return complain(model.error());

  const auto& metadata = Internal::weights(*model).metadata;
  const Json config = Json::parse(model::to_json(model->config()));
  if (options.json != "-") {
    std::cout << model->name() << ": " << model->parameter_count() << " parameters in "
              << model->tensor_count() << " tensors, mode " << mode_name(model->mode()) << '\n';
    for (const auto& [name, value] : config.items())
      std::cout << "  " << name << std::string(name.size() < 24 ? 24 - name.size() : 1, ' ') << value << '\n';
    for (const auto& [key, value] : metadata)
      std::cout << "metadata " << io::in_quotes(key) << " = " << io::in_quotes(value) << '\n';
  }
  if (options.json.empty()) return done;
  const auto written = write_json(options.json, {{"name", model->name()},
                                                 {"parameters", model->parameter_count()},
                                                 {"tensors", model->tensor_count()},
                                                 {"mode", mode_name(model->mode())},
                                                 {"config", config},
                                                 {"metadata", metadata}});
  return written ? done : complain(written.error());
}

}  // namespace

Command add_model_info(CLI::App& model) {
  auto options = std::make_shared<InfoOptions>();
  CLI::App* app = add_command(model, "info", "Configuration, size and metadata of a model");
  app->add_option("MODEL", options->input, "Weights (.safetensors), or the name of a model that ships")
      ->required()
      ->type_name("FILE|NAME");
  add_json(*app, options->json);
  app->footer(
      "Example:\n"
      "  bitr model info model.safetensors --json -");
  return {app, [options] { return run(*options); }};
}

}  // namespace bitr::tool
