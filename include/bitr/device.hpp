// Where a plan runs: the CPU, or a GPU through Vulkan.
#pragma once

#include <bitr/result.hpp>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace bitr {

struct Internal;
class ThreadPool;
namespace vk {
class Context;
}

enum class Backend : std::uint8_t { cpu, vulkan };

/// "cpu" or "vulkan".
std::string_view name(Backend backend);

/// A choice among variants of a Vulkan device's kernels. Each asks more of the device than the one before;
/// all give the same poses up to rounding.
enum class Tier : std::uint8_t {
  basic,    ///< nothing beyond Vulkan 1.2: every invocation loads what it needs
  shuffle,  ///< subgroups of 8 to 32 invocations exchange what they load
  texels,   ///< the same, and vec4s are read through texel buffers: for drivers that compute on the CPU
};

/// "basic", "shuffle" or "texels".
std::string_view name(Tier tier);
/// Nothing if no tier has that name.
std::optional<Tier> tier_named(std::string_view name);

/// A handle to a backend and its threads; cheap to copy, and what it stands for lives as long as a handle or
/// a plan on it does. Plans on one device may be used from different threads, one thread at a time per plan.
class Device {
 public:
  Backend backend() const;
  const std::string& name() const;  ///< the processor's model name or the GPU's, as system or driver give it
  /// CPU threads. A Vulkan device has them for what it leaves to the CPU: packing, diagnostics.
  unsigned threads() const;

  // What only a Vulkan device has; empty or false on the CPU.
  std::string driver() const;  ///< the driver's name and version
  std::string tier() const;    ///< the name of the tier in use
  bool lost() const;           ///< it stopped answering: every call on its plans fails with `device_lost`
  /// Compiled kernels in the driver's form, to be given to create_device() next time; grows with the plans
  /// made so far. Empty when the driver has nothing to give.
  std::vector<std::byte> pipeline_cache() const;
  /// What the validation layers complained about so far, if DeviceOptions asked for them.
  std::vector<std::string> validation_messages() const;

 private:
  friend struct Internal;
  Device(std::shared_ptr<ThreadPool> pool, std::shared_ptr<vk::Context> context)
      : pool_(std::move(pool)), context_(std::move(context)) {}
  std::shared_ptr<ThreadPool> pool_;
  std::shared_ptr<vk::Context> context_;  // null on the CPU
};

/// The CPU backend. `threads` = 0 takes every core the process may run on; never more than 1024, or than the
/// system grants (see Device::threads). Results do not depend on the number.
Device cpu_device(unsigned threads = 0);

/// What the system's Vulkan loader shows.
struct DeviceInfo {
  unsigned index = 0;  ///< in the loader's order, as DeviceOptions::device takes it
  std::string name;
  std::string driver;               ///< name and version
  std::string type;                 ///< "discrete", "integrated", "virtual", "cpu" or "other"
  std::string api_version;          ///< "1.3.230"
  std::string tier;                 ///< the name of the one it gets unless DeviceOptions asks for another
  std::vector<std::string> tiers;   ///< names of those that it can execute
  unsigned subgroup_size = 1;       ///< as the driver reports it
  std::uint64_t memory_bytes = 0;   ///< its largest own heap
  std::vector<std::string> quirks;  ///< what its driver is known to do wrong and the kernels steer around
  std::string unsuitable;           ///< why it cannot be used; empty if it can

  /// A processor of its own, rather than a driver that computes on the CPU.
  bool is_gpu() const { return type == "discrete" || type == "integrated" || type == "virtual"; }
};

/// Every physical device, usable or not; none where there is no Vulkan at all.
Result<std::vector<DeviceInfo>> enumerate_devices();

/// Vulkan's validation layers between the library and the driver, for debugging: they are slow.
enum class Validation : std::uint8_t {
  off,
  core,             ///< wrong use of the API
  synchronization,  ///< also missing barriers
  gpu_assisted,     ///< also accesses outside of buffers, inside the kernels
};

struct DeviceOptions {
  /// A number is an index into enumerate_devices(), anything else a part of a name, whatever its case; empty
  /// takes the best, discrete GPUs first and drivers on the CPU last.
  std::string device = {};
  unsigned threads = 0;  ///< as for cpu_device
  Validation validation = Validation::off;
  std::optional<Tier> tier = {};  ///< empty: the best for the device
  /// What Device::pipeline_cache() gave earlier: kernels need not be compiled again. Ignored when it is of
  /// another device or driver, or damaged.
  std::vector<std::byte> pipeline_cache = {};
};

/// A Vulkan device with one queue for compute. `no_device` when there is none, none of the asked index or
/// name, or it is unsuitable; `unsupported` when it cannot execute the asked tier, or the validation layers
/// are asked for and not installed.
Result<Device> create_device(const DeviceOptions& options = {});

}  // namespace bitr
