// bitr model convert: weights to safetensors, from the training code's checkpoint or from safetensors.
#include <CLI/CLI.hpp>
#include <bitr/io.hpp>
#include <bitr/model.hpp>
#include <iostream>
#include <memory>

#include "command.hpp"
#include "options.hpp"
#include "output.hpp"

namespace bitr::tool {
namespace {

struct ConvertOptions {
  std::string input, output;
  ModelOptions model;
  bool half = false;
};

int run(ConvertOptions& options) {
  if (const auto checked = check_output("OUT", options.output, {options.input}); !checked)
    return complain(checked.error());
  set_at_hand(options.input);
  options.model.name = std::filesystem::path(options.output).stem().string();
  const bool safetensors = std::filesystem::path(options.input).extension() == ".safetensors";
  const auto model = safetensors ? load_model(std::filesystem::path(options.input), options.model)
                                 : load_torch_checkpoint(options.input, options.model);
  if (!model) return complain(model.error());
  const auto bytes = serialize(*model, options.half ? WeightPrecision::f16 : WeightPrecision::f32);
  if (const auto readable = load_model(bytes, {.name = options.output, .mode = {}}); !readable)
    return complain(readable.error());
  if (const auto written = io::write_file(options.output, bytes); !written) return complain(written.error());
  std::cout << options.output << ": " << model->parameter_count() << " parameters in "
            << model->tensor_count() << " tensors, mode " << mode_name(model->mode()) << '\n';
  return done;
}

}  // namespace

Command add_model_convert(CLI::App& model) {
  auto options = std::make_shared<ConvertOptions>();
  CLI::App* app =
      add_command(model, "convert", "Convert a PyTorch checkpoint, or safetensors, to safetensors");
  app->add_option("IN", options->input, "Checkpoint written by torch.save (.pt), or .safetensors")
      ->required()
      ->type_name("FILE");
  app->add_option("OUT", options->output, "Weights to write (.safetensors)")->required()->type_name("FILE");
  app->add_flag("--half", options->half,
                "Write numbers of 16 bits: half the size, weights rounded to 11 bits");
  add_mode(*app, options->model.mode, "Mode to record in the file (default: what the checkpoint asks for)");
  app->footer(
      "The checkpoint is read by a reader that can only build tensors and plain containers: no code in it "
      "runs.\n\n"
      "Example:\n"
      "  bitr model convert checkpoint.pt model.safetensors --mode scale-exact\n"
      "  bitr model convert mine.safetensors small.safetensors --half");
  return {app, [options] { return run(*options); }};
}

}  // namespace bitr::tool
