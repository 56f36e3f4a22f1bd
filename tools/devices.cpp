// bitr devices: what Vulkan sees, and what each device gets.
#include <CLI/CLI.hpp>
#include <memory>

#include "command.hpp"
#include "device_choice.hpp"
#include "options.hpp"
#include "output.hpp"

namespace bitr::tool {
namespace {

Json to_json(const DeviceInfo& info) {
  return {{"index", info.index},
          {"name", info.name},
          {"driver", info.driver},
          {"type", info.type},
          {"api_version", info.api_version},
          {"tier", info.tier},
          {"tiers", info.tiers},
          {"subgroup_size", info.subgroup_size},
          {"memory_bytes", info.memory_bytes},
          {"quirks", info.quirks},
          {"usable", info.unsuitable.empty()},
          {"unsuitable", info.unsuitable.empty() ? Json(nullptr) : Json(info.unsuitable)}};
}

void print(const DeviceInfo& info) {
  constexpr double gibibyte = 1 << 30;
  std::printf("%u  %s\n", info.index, info.name.c_str());
  std::printf("   %s, driver %s, Vulkan %s\n", info.type.c_str(), info.driver.c_str(),
              info.api_version.c_str());
  std::string others;
  for (const std::string& tier : info.tiers)
    if (tier != info.tier) others += (others.empty() ? " (also " : ", ") + tier;
  if (!others.empty()) others += ")";
  std::printf("   tier %s%s, subgroups of %u, %.1f GiB\n", info.tier.c_str(), others.c_str(),
              info.subgroup_size, static_cast<double>(info.memory_bytes) / gibibyte);
  for (const std::string& quirk : info.quirks) std::printf("   quirk: %s\n", quirk.c_str());
  if (!info.unsuitable.empty()) std::printf("   cannot be used: %s\n", info.unsuitable.c_str());
}

int run(const std::string& json) {
  const auto devices = enumerate_devices();
  if (!devices) return complain(devices.error());
  const DeviceInfo* gpu = best_gpu(*devices);
  const Backend backend = gpu ? Backend::vulkan : Backend::cpu;
  const std::string chosen = gpu ? gpu->name : cpu_device(1).name();
  if (json != "-") {
    for (const DeviceInfo& info : *devices) print(info);
    if (devices->empty()) std::printf("no Vulkan device\n");
    std::printf("--backend auto runs on %s (%s)\n", chosen.c_str(), name(backend).data());
  }
  if (json.empty()) return done;
  Json list = Json::array();
  for (const DeviceInfo& info : *devices) list.push_back(to_json(info));
  const auto written = write_json(
      json, {{"devices", std::move(list)}, {"auto", {{"backend", name(backend)}, {"device", chosen}}}});
  return written ? done : complain(written.error());
}

}  // namespace

Command add_devices(CLI::App& root) {
  auto json = std::make_shared<std::string>();
  CLI::App* app = add_command(root, "devices", "List the Vulkan devices and what each of them gets");
  add_optional_json(*app, *json);
  app->footer(
      "A tier is a choice among variants of the kernels, which --tier of other commands makes: \"basic\" "
      "needs "
      "nothing\nbeyond Vulkan 1.2, \"shuffle\" exchanges loads within subgroups of 8 to 32 invocations, "
      "\"texels\" "
      "reads vec4s\nthrough texel buffers as well, which suits drivers that compute on the CPU. "
      "VK_DRIVER_FILES, "
      "which the Vulkan\nloader reads, chooses the drivers.\n\n"
      "Examples:\n"
      "  bitr devices\n"
      "  bitr devices --json");
  return {app, [json] { return run(*json); }};
}

}  // namespace bitr::tool
