// bitr: the command.
#include <CLI/CLI.hpp>
#include <csignal>
#include <cstdio>
#include <iostream>
#include <new>
#include <string>
#include <system_error>
#include <vector>

#include "command.hpp"
#include "options.hpp"
#include "output.hpp"

namespace {

using namespace bitr::tool;

int run(int argc, char** argv) {
  CLI::App app("Assembles pairs of 3-D point clouds.", "bitr");
  app.set_version_flag("--version", "bitr " BITR_VERSION);
  app.require_subcommand(1);
  app.footer(
      "The files of a result appear together or not at all; until then what they replace stays.\n\n"
      "Examples:\n"
      "  bitr generate copy --out clouds --count 1 --seed 1\n"
      "  bitr assemble clouds/copy_000_source.ply clouds/copy_000_reference.ply --complete-match -o "
      "assembled.ply\n"
      "  bitr assemble --help");
  std::vector<Command> commands = {add_assemble(app), add_batch(app),   add_generate(app),
                                   add_bench(app),    add_devices(app), add_doctor(app),
                                   add_eval(app),     add_train(app),   add_refine(app)};
  CLI::App* model = add_command(app, "model", "Look into weights, convert them");
  model->require_subcommand(1);
  model->footer(
      "Examples:\n"
      "  bitr model info model.safetensors\n"
      "  bitr model convert checkpoint.pt model.safetensors");
  commands.push_back(add_model_info(*model));
  commands.push_back(add_model_convert(*model));
  commands.push_back(add_help(app));
  commands.push_back(add_completion(app));
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == static_cast<int>(CLI::ExitCodes::Success)) return app.exit(error);
    // An unknown command comes out as a missing one.
    const auto unknown = app.remaining(true);
    if (error.get_name() == "RequiredError" && !unknown.empty())
      return complain(bad_usage, "\"" + unknown.front() + "\" is not known here; see --help");
    return complain(bad_usage, error.what());
  }
  for (const Command& command : commands) {
    if (!command.app->parsed()) continue;
    set_at_hand("bitr " + command.app->get_name());
    return command.run();
  }
  return complain(bad_usage, "no command");
}

}  // namespace

int main(int argc, char** argv) {
  // A file over its limit is an error like a full disk.
  std::signal(SIGXFSZ, SIG_IGN);
  int status = run_failed;
  try {
    status = run(argc, argv);
  } catch (const std::bad_alloc&) {
    return complain(run_failed, at_hand() + "out of memory");
  } catch (const std::system_error& error) {
    return complain(run_failed, at_hand() + error.what());
  } catch (const std::exception& error) {
    return complain(run_failed, error.what());
  }
  // Text is printed to the same stream in two ways; the one does not notice that the other failed.
  if (status == done && (!std::cout.flush() || std::ferror(stdout) != 0))
    return complain(bad_usage, "standard output cannot be written");
  return status;
}
