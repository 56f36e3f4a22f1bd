#include "device_choice.hpp"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <bitr/io.hpp>
#include <cctype>
#include <charconv>
#include <cstdlib>

#include "core/hash.hpp"
#include "options.hpp"
#include "output.hpp"

namespace bitr::tool {
namespace {

constexpr std::uintmax_t most_cache_bytes = std::uintmax_t{256} << 20;

std::string lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

int rank(const DeviceInfo& info) {
  return info.type == "discrete" ? 0 : info.type == "integrated" ? 1 : info.type == "virtual" ? 2 : 3;
}

// The one create_device() would take; null when it would take none.
const DeviceInfo* find(const std::vector<DeviceInfo>& devices, const std::string& wanted) {
  std::size_t index = 0;
  const char* end = wanted.data() + wanted.size();
  if (!wanted.empty() && std::from_chars(wanted.data(), end, index).ptr == end)
    return index < devices.size() ? &devices[index] : nullptr;
  const DeviceInfo* best = nullptr;
  for (const DeviceInfo& info : devices) {
    if (!info.unsuitable.empty() || lower(info.name).find(lower(wanted)) == std::string::npos) continue;
    if (!best || rank(info) < rank(*best)) best = &info;
  }
  return best;
}

std::filesystem::path cache_folder() {
  // As the XDG base directory specification has it; a relative path counts as none.
  if (const char* cache = std::getenv("XDG_CACHE_HOME"); cache && *cache == '/')
    return std::filesystem::path(cache) / "bitr";
  if (const char* home = std::getenv("HOME"); home && *home == '/')
    return std::filesystem::path(home) / ".cache" / "bitr";
  return {};
}

// One file for each device and driver, with a name that a person recognises.
std::filesystem::path cache_file(const DeviceInfo& info) {
  const std::filesystem::path folder = cache_folder();
  if (folder.empty()) return {};
  std::string file;
  for (const char c : lower(info.name))
    if (std::isalnum(static_cast<unsigned char>(c)))
      file += c;
    else if (!file.empty() && file.back() != '-')
      file += '-';
  file.resize(std::min<std::size_t>(file.size(), 60));
  const std::string whole = info.name + '\n' + info.driver + '\n' + info.api_version;
  char digits[17];
  std::snprintf(digits, sizeof digits, "%016llx",
                static_cast<unsigned long long>(fnv1a(std::as_bytes(std::span(whole)))));
  return folder / (file + "-" + digits + ".pipelines");
}

std::vector<std::byte> read_cache(const std::filesystem::path& file) {
  std::error_code error;
  if (file.empty() || !std::filesystem::is_regular_file(file, error)) return {};
  if (std::filesystem::file_size(file, error) > most_cache_bytes || error) return {};
  return io::read_file(file).value_or(std::vector<std::byte>());
}

// The one to use of a Vulkan device: as asked, as the environment has it, or the best.
Result<std::optional<Tier>> tier_of(const DeviceChoice& choice) {
  if (choice.tier) return choice.tier;
  const char* text = std::getenv("BITR_TIER");
  if (!text || !*text) return std::nullopt;
  if (const auto tier = tier_named(text)) return tier;
  return fail(ErrorCode::invalid_argument,
              std::string("BITR_TIER=") + text + " is not one of basic, shuffle, texels");
}

Result<OpenDevice> open_vulkan(const DeviceChoice& choice, const DeviceInfo* info) {
  const auto tier = tier_of(choice);
  if (!tier) return tl::unexpected(tier.error());
  DeviceOptions options{.device = info ? std::to_string(info->index) : choice.device,
                        .threads = static_cast<unsigned>(choice.threads),
                        .tier = *tier};
  const std::filesystem::path file = info && !choice.no_cache ? cache_file(*info) : std::filesystem::path();
  options.pipeline_cache = read_cache(file);
  auto device = create_device(options);
  if (!device) return tl::unexpected(device.error());
  return OpenDevice(std::move(*device), file, std::move(options.pipeline_cache));
}

}  // namespace

void add_device_options(CLI::App& app, DeviceChoice& choice) {
  add_choice<std::optional<Backend>>(
      app, "--backend", {{"auto", std::nullopt}, {"vulkan", Backend::vulkan}, {"cpu", Backend::cpu}},
      choice.backend, "Where to run; auto: the best GPU that Vulkan shows, else the CPU")
      ->default_str("auto");
  app.add_option("--device", choice.device, "Vulkan device, as `bitr devices` lists it")
      ->type_name("INDEX|NAME");
  add_choice<Tier>(
      app, "--tier", {{"basic", Tier::basic}, {"shuffle", Tier::shuffle}, {"texels", Tier::texels}},
      choice.tier,
      "Variant of the Vulkan device's kernels; otherwise the best for it, as `bitr devices` lists it");
  app.add_flag("--no-cache", choice.no_cache, "Neither read nor keep the device's compiled kernels");
  add_count(app, "--threads", choice.threads, 0, 4096,
            "CPU threads, 0 for every core; results do not depend on them");
}

const DeviceInfo* best_gpu(const std::vector<DeviceInfo>& devices) {
  const DeviceInfo* best = find(devices, "");
  return best && best->is_gpu() ? best : nullptr;
}

void OpenDevice::save_cache() const {
  if (cache_file_.empty()) return;
  const std::vector<std::byte> blob = device_.pipeline_cache();
  if (blob.empty() || blob == loaded_) return;
  std::error_code ignored;
  std::filesystem::create_directories(cache_file_.parent_path(), ignored);
  // Nothing but a file keeps anything, and a pipe keeps its writer waiting.
  const auto status = std::filesystem::status(cache_file_, ignored);
  if (std::filesystem::exists(status) && !std::filesystem::is_regular_file(status)) return;
  (void)io::write_file(cache_file_, blob);
}

Result<OpenDevice> open_device(const DeviceChoice& choice, bool cpu_only) {
  const auto cpu = [&] { return OpenDevice(cpu_device(static_cast<unsigned>(choice.threads))); };
  if (choice.backend == Backend::cpu) {
    if (!choice.device.empty())
      return fail(ErrorCode::invalid_argument,
                  "--device " + choice.device + ": chooses among Vulkan devices, --backend is cpu");
    if (choice.tier)
      return fail(ErrorCode::invalid_argument, "--tier " + std::string(name(*choice.tier)) +
                                                   ": chooses among Vulkan kernels, --backend is cpu");
    return cpu();
  }
  const bool asked = choice.backend == Backend::vulkan || !choice.device.empty() || choice.tier;
  if (!asked && cpu_only) return cpu();
  const auto devices = enumerate_devices();
  if (asked) {
    if (!devices) return tl::unexpected(devices.error());
    auto opened = open_vulkan(choice, find(*devices, choice.device));
    if (opened) return opened;
    const std::string option = !choice.device.empty() ? "--device " + choice.device
                               : choice.tier          ? "--tier " + std::string(name(*choice.tier))
                                                      : "--backend vulkan";
    return fail(opened.error().code, option + ": " + opened.error().message);
  }
  const DeviceInfo* gpu = devices ? best_gpu(*devices) : nullptr;
  if (!gpu) return cpu();
  auto opened = open_vulkan(choice, gpu);
  if (opened) return opened;
  warn(gpu->name + " cannot be used, running on the CPU: " + opened.error().message);
  return cpu();
}

}  // namespace bitr::tool
