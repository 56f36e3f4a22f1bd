// bitr doctor: whether a device computes what the network needs.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <bitr/doctor.hpp>
#include <cmath>
#include <memory>

#include "command.hpp"
#include "device_choice.hpp"
#include "options.hpp"
#include "output.hpp"

namespace bitr::tool {
namespace {

struct DoctorOptions {
  DeviceChoice device;
  std::string json;
};

Json to_json(const Check& check) {
  return {
      {"name", check.name},
      {"passed", check.passed()},
      {"measured", std::isfinite(check.measured) && check.problem.empty() ? Json(check.measured) : nullptr},
      {"allowed", check.allowed},
      {"problem", check.problem.empty() ? Json(nullptr) : Json(check.problem)}};
}

void print(const std::vector<Check>& checks) {
  std::size_t width = 0;
  for (const Check& check : checks) width = std::max(width, check.name.size());
  for (const Check& check : checks) {
    std::printf("%s  %-*s  ", check.passed() ? "PASS" : "FAIL", static_cast<int>(width), check.name.c_str());
    if (check.problem.empty())
      std::printf("%-9.3g allowed %.3g\n", check.measured, check.allowed);
    else
      std::printf("%s\n", check.problem.c_str());
  }
}

int run(const DoctorOptions& options) {
  if (const auto checked = check_output("--json", options.json); !checked) return complain(checked.error());
  const auto device = open_device(options.device);
  if (!device) return complain(device.error());
  show_progress("checking " + (*device)->name());
  const auto checks = run_doctor(**device);
  if (!checks) return complain(checks.error());
  clear_progress();
  device->save_cache();

  const auto failed =
      std::count_if(checks->begin(), checks->end(), [](const Check& c) { return !c.passed(); });
  if (options.json != "-") {
    print(*checks);
    std::printf("%zu of %zu checks passed on %s (%s)\n", checks->size() - static_cast<std::size_t>(failed),
                checks->size(), (*device)->name().c_str(), name((*device)->backend()).data());
  }
  if (!options.json.empty()) {
    Json list = Json::array();
    for (const Check& check : *checks) list.push_back(to_json(check));
    const auto written = write_json(options.json, {{"backend", name((*device)->backend())},
                                                   {"device", (*device)->name()},
                                                   {"driver", (*device)->driver()},
                                                   {"tier", (*device)->tier()},
                                                   {"passed", failed == 0},
                                                   {"checks", std::move(list)}});
    if (!written) return complain(written.error());
  }
  return failed == 0 ? done : run_failed;
}

}  // namespace

Command add_doctor(CLI::App& root) {
  auto options = std::make_shared<DoctorOptions>();
  CLI::App* app = add_command(root, "doctor", "Check that a device computes the network correctly");
  add_device_options(*app, options->device);
  add_optional_json(*app, options->json);
  app->footer(
      "Every operation of the network against the CPU in double precision, then whole passes: moved, "
      "exchanged,\nscaled and reordered clouds, and the same bits in every run.\n"
      "Exit status: 0 all passed; 1 a check failed, or the device was lost; 2 no such device.\n\n"
      "Examples:\n"
      "  bitr doctor\n"
      "  bitr doctor --backend vulkan --device 0 --json doctor.json");
  return {app, [options] { return run(*options); }};
}

}  // namespace bitr::tool
