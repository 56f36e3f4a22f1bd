// Which device a command runs on, and how: --backend, --device, --tier, --threads, --no-cache.
#pragma once

#include <bitr/device.hpp>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "cli.hpp"

namespace bitr::tool {

struct DeviceChoice {
  std::optional<Backend> backend;  ///< empty: auto
  std::string device;              ///< index or part of a name
  std::optional<Tier> tier;        ///< empty: the environment's BITR_TIER, or else the best for the device
  std::uint64_t threads = 0;
  bool no_cache = false;
};
void add_device_options(CLI::App& app, DeviceChoice& choice);

/// What auto takes: the best Vulkan device that is a GPU; null where the CPU is better than what there is.
const DeviceInfo* best_gpu(const std::vector<DeviceInfo>& devices);

/// A device, and the file that keeps its compiled kernels for the next run.
class OpenDevice {
 public:
  explicit OpenDevice(Device device) : device_(std::move(device)) {}
  OpenDevice(Device device, std::filesystem::path cache_file, std::vector<std::byte> loaded)
      : device_(std::move(device)), cache_file_(std::move(cache_file)), loaded_(std::move(loaded)) {}

  const Device& operator*() const { return device_; }
  const Device* operator->() const { return &device_; }
  /// Writes the file if there is something new; whether it can be written is nobody's concern.
  void save_cache() const;

 private:
  Device device_;
  std::filesystem::path cache_file_;  ///< empty: none
  std::vector<std::byte> loaded_;
};

/// `cpu_only`: the plan needs what only the CPU does, so auto takes it.
Result<OpenDevice> open_device(const DeviceChoice& choice, bool cpu_only = false);

}  // namespace bitr::tool
