// A subcommand: its options are bound when it is added, and main runs it once everything has been parsed.
#pragma once

#include <functional>

#include "cli.hpp"

namespace bitr::tool {

/// Exit statuses that scripts depend on.
enum ExitStatus {
  done = 0,
  run_failed = 1,  ///< ran, but the result is not to be used
  bad_usage = 2,   ///< bad input or options
};

struct Command {
  CLI::App* app;
  std::function<int()> run;  ///< the exit status
};

Command add_assemble(CLI::App& root);
Command add_batch(CLI::App& root);
Command add_generate(CLI::App& root);
Command add_refine(CLI::App& root);
Command add_model_info(CLI::App& model);
Command add_model_convert(CLI::App& model);
Command add_bench(CLI::App& root);
Command add_devices(CLI::App& root);
Command add_doctor(CLI::App& root);
Command add_train(CLI::App& root);
Command add_eval(CLI::App& root);
Command add_help(CLI::App& root);
Command add_completion(CLI::App& root);

}  // namespace bitr::tool
