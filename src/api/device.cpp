#include <bitr/device.hpp>
#include <fstream>

#include "api/internal.hpp"
#include "core/guarded.hpp"
#include "core/thread_pool.hpp"
#include "vk/device.hpp"

namespace bitr {
namespace {

constexpr Tier tiers[] = {Tier::basic, Tier::shuffle, Tier::texels};

std::string processor_name() {
  std::ifstream info("/proc/cpuinfo");
  for (std::string line; std::getline(info, line);)
    if (line.rfind("model name", 0) == 0)
      if (const auto at = line.find(": "); at != std::string::npos) return line.substr(at + 2);
  return "CPU";
}

const char* type_name(VkPhysicalDeviceType type) {
  switch (type) {
    case VK_PHYSICAL_DEVICE_TYPE_DISCRETE_GPU:
      return "discrete";
    case VK_PHYSICAL_DEVICE_TYPE_INTEGRATED_GPU:
      return "integrated";
    case VK_PHYSICAL_DEVICE_TYPE_VIRTUAL_GPU:
      return "virtual";
    case VK_PHYSICAL_DEVICE_TYPE_CPU:
      return "cpu";
    default:
      return "other";
  }
}

std::string version_text(std::uint32_t version) {
  return std::to_string(VK_API_VERSION_MAJOR(version)) + "." + std::to_string(VK_API_VERSION_MINOR(version)) +
         "." + std::to_string(VK_API_VERSION_PATCH(version));
}

DeviceInfo info_of(const vk::Capabilities& c, std::size_t index) {
  DeviceInfo info{.index = static_cast<unsigned>(index),
                  .name = c.name,
                  .driver = c.driver,
                  .type = type_name(c.type),
                  .api_version = version_text(c.api_version),
                  .tier = std::string(name(c.tier())),
                  .tiers = {},
                  .subgroup_size = c.subgroup_size,
                  .memory_bytes = c.memory_bytes,
                  .quirks = {},
                  .unsuitable = c.unsuitable};
  for (const Tier tier : tiers)
    if (c.executes(tier)) info.tiers.emplace_back(name(tier));
  for (const vk::Quirk* quirk : c.quirks) info.quirks.emplace_back(quirk->reason);
  return info;
}

}  // namespace

std::string_view name(Backend backend) { return backend == Backend::vulkan ? "vulkan" : "cpu"; }

std::string_view name(Tier tier) {
  return tier == Tier::texels ? "texels" : tier == Tier::shuffle ? "shuffle" : "basic";
}

std::optional<Tier> tier_named(std::string_view word) {
  for (const Tier tier : tiers)
    if (name(tier) == word) return tier;
  return std::nullopt;
}

Backend Device::backend() const { return context_ ? Backend::vulkan : Backend::cpu; }
const std::string& Device::name() const {
  static const std::string processor = processor_name();
  return context_ ? context_->capabilities().name : processor;
}
unsigned Device::threads() const { return pool_->threads(); }
std::string Device::driver() const { return context_ ? context_->capabilities().driver : ""; }
std::string Device::tier() const {
  return context_ ? std::string(bitr::name(context_->capabilities().tier())) : "";
}
bool Device::lost() const { return context_ && context_->lost(); }

std::vector<std::byte> Device::pipeline_cache() const {
  using Blob = std::vector<std::byte>;
  if (!context_ || lost()) return {};
  return guarded([&]() -> Result<Blob> { return context_->pipeline_cache(); }).value_or(Blob());
}

std::vector<std::string> Device::validation_messages() const {
  return context_ ? context_->validation_messages() : std::vector<std::string>();
}

Device cpu_device(unsigned threads) { return Internal::device(std::make_shared<ThreadPool>(threads)); }

Result<std::vector<DeviceInfo>> enumerate_devices() {
  auto devices = guarded([]() -> Result<std::vector<DeviceInfo>> {
    std::vector<DeviceInfo> all;
    for (const vk::Capabilities& c : vk::physical_devices()) all.push_back(info_of(c, all.size()));
    return all;
  });
  if (!devices && devices.error().code == ErrorCode::no_device) return std::vector<DeviceInfo>();
  return devices;
}

Result<Device> create_device(const DeviceOptions& options) {
  return guarded([&]() -> Result<Device> {
    auto context = std::make_shared<vk::Context>(
        vk::OwnDevice{.device = options.device,
                      .validate = options.validation != Validation::off,
                      .validate_synchronization = options.validation == Validation::synchronization,
                      .validate_on_gpu = options.validation == Validation::gpu_assisted,
                      .pipeline_cache = options.pipeline_cache,
                      .tier = options.tier});
    return Internal::device(std::make_shared<ThreadPool>(options.threads), std::move(context));
  });
}

}  // namespace bitr
