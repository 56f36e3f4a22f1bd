// A logical device with one queue: created here, or the host's.
#pragma once

#include <array>
#include <atomic>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "vk/capabilities.hpp"
#include "vk/shader.hpp"

namespace bitr::vk {

class Context;

/// Throws Failure: `device_lost`, or `internal` naming the call and its result.
void check(VkResult result, std::string_view what);

/// Memory of one buffer. Host-visible ones stay mapped and are coherent.
class Buffer {
 public:
  Buffer() = default;
  /// Throws Failure (`internal`) with the size when memory runs out.
  Buffer(const Context& context, VkDeviceSize bytes, bool host_visible);
  Buffer(Buffer&& other) noexcept { swap(other); }
  Buffer& operator=(Buffer&& other) noexcept {
    swap(other);
    return *this;
  }
  ~Buffer();

  VkBuffer handle() const { return buffer_; }
  VkDeviceSize size() const { return bytes_; }
  std::byte* data() const { return mapped_; }  ///< null unless host-visible

 private:
  void swap(Buffer& other);
  const Context* context_ = nullptr;
  VkBuffer buffer_ = VK_NULL_HANDLE;
  VkDeviceMemory memory_ = VK_NULL_HANDLE;
  VkDeviceSize bytes_ = 0;
  std::byte* mapped_ = nullptr;
};

/// What a shader's binding of that access is bound to.
VkDescriptorType descriptor_type(Access access);

struct Pipeline {
  const Shader* shader = nullptr;
  VkPipeline pipeline = VK_NULL_HANDLE;
  VkPipelineLayout layout = VK_NULL_HANDLE;
  VkDescriptorSetLayout set_layout = VK_NULL_HANDLE;
};

/// A pipeline whose shader takes these push constants.
template <class Parameters>
class PipelineOf {
 public:
  PipelineOf() = default;
  explicit PipelineOf(const Pipeline& pipeline) : pipeline_(&pipeline) {}
  explicit operator bool() const { return pipeline_; }
  const Pipeline& operator*() const { return *pipeline_; }

 private:
  const Pipeline* pipeline_ = nullptr;
};

/// What the host brings when it shares its device.
struct HostDevice {
  PFN_vkGetInstanceProcAddr get_instance_proc_addr;
  VkInstance instance;
  VkPhysicalDevice physical_device;
  VkDevice device;
  VkQueue queue;
  std::uint32_t queue_family;
  VkPipelineCache pipeline_cache;
  const VkAllocationCallbacks* allocation;
  std::function<void()> lock, unlock;
  bool subgroup_size_control = false;  ///< it enabled subgroupSizeControl and computeFullSubgroups
  std::optional<Tier> tier = {};       ///< as in OwnDevice
};

struct OwnDevice {
  std::string device = {};  ///< index, part of the name, or empty for the best
  bool validate = false, validate_synchronization = false, validate_on_gpu = false;
  std::span<const std::byte> pipeline_cache = {};
  std::optional<Tier> tier = {};  ///< empty: the best for the device
};

class Context {
 public:
  explicit Context(const OwnDevice& wanted);
  explicit Context(const HostDevice& host);
  ~Context();
  Context(const Context&) = delete;
  Context& operator=(const Context&) = delete;

  const Capabilities& capabilities() const { return capabilities_; }
  const DeviceFunctions& vk() const { return vk_; }
  /// For tests that simulate a driver's failures.
  DeviceFunctions& functions() { return vk_; }
  VkDevice device() const { return device_; }
  std::uint32_t queue_family() const { return queue_family_; }
  const VkAllocationCallbacks* allocation() const { return allocation_; }
  const VkPhysicalDeviceMemoryProperties& memory() const { return memory_; }

  /// Made on first use, kept for the device's life; from any thread. `specializations` are constants 0 … n−1.
  template <class Parameters, std::size_t Count>
  PipelineOf<Parameters> pipeline(
      const ShaderOf<Parameters, Count>& shader,
      const std::type_identity_t<std::array<std::uint32_t, Count>>& specializations) const {
    return PipelineOf<Parameters>(find_pipeline(shader, specializations));
  }
  /// Throws Failure (`internal`) for another number of them than the shader has.
  template <class Parameters, std::size_t Count>
  PipelineOf<Parameters> pipeline(const ShaderOf<Parameters, Count>& shader,
                                  const std::vector<std::uint32_t>& specializations) const {
    return PipelineOf<Parameters>(find_pipeline(shader, specializations));
  }
  std::size_t pipeline_count() const;
  /// Names of the shaders that pipelines were made of so far.
  std::set<std::string> shaders() const;
  /// The driver's cache behind this library's own header; empty if the driver gives none.
  std::vector<std::byte> pipeline_cache() const;

  /// Under the host's queue lock; signals `semaphore` with `value`. Throws as check().
  void submit(VkCommandBuffer commands, VkSemaphore semaphore, std::uint64_t value) const;
  /// Throws as check(); a lost device stays lost.
  void wait(VkSemaphore semaphore, std::uint64_t value) const;
  bool lost() const { return lost_; }

  /// What the validation layers complained about so far.
  std::vector<std::string> validation_messages() const;
  /// Device memory allocations made since the device exists.
  std::size_t allocations() const { return allocations_; }
  void count_allocation() const { ++allocations_; }

 private:
  void create_instance(const OwnDevice& wanted);
  VkPhysicalDevice choose(const std::string& wanted);
  void create_device();
  void create_cache(std::span<const std::byte> blob);
  const Pipeline& find_pipeline(const Shader& shader, std::span<const std::uint32_t> specializations) const;
  void note_lost(VkResult result) const;
  void destroy() noexcept;

  PFN_vkGetInstanceProcAddr get_instance_proc_addr_ = nullptr;
  std::unique_ptr<InstanceFunctions> instance_functions_;
  bool own_ = true;
  VkInstance instance_ = VK_NULL_HANDLE;
  VkDebugUtilsMessengerEXT messenger_ = VK_NULL_HANDLE;
  VkPhysicalDevice physical_device_ = VK_NULL_HANDLE;
  VkDevice device_ = VK_NULL_HANDLE;
  VkQueue queue_ = VK_NULL_HANDLE;
  std::uint32_t queue_family_ = 0;
  const VkAllocationCallbacks* allocation_ = nullptr;
  DeviceFunctions vk_;
  Capabilities capabilities_;
  VkPhysicalDeviceMemoryProperties memory_{};
  std::function<void()> lock_, unlock_;
  mutable std::mutex queue_mutex_;
  VkPipelineCache cache_ = VK_NULL_HANDLE;
  bool own_cache_ = true;
  mutable std::mutex pipelines_mutex_;
  struct Layouts {
    VkPipelineLayout layout;
    VkDescriptorSetLayout set_layout;
  };
  mutable std::map<const Shader*, Layouts> layouts_;
  mutable std::map<std::pair<const Shader*, std::vector<std::uint32_t>>, Pipeline> pipelines_;
  mutable std::mutex messages_mutex_;
  mutable std::vector<std::string> messages_;
  mutable std::atomic<std::size_t> allocations_{0};
  mutable std::atomic<bool> lost_{false};
  friend VkBool32 note_message(VkDebugUtilsMessageSeverityFlagBitsEXT, VkDebugUtilsMessageTypeFlagsEXT,
                               const VkDebugUtilsMessengerCallbackDataEXT*, void*);
};

/// Every physical device the system's loader shows, in its order. Throws Failure (`no_device`) without one.
std::vector<Capabilities> physical_devices();

}  // namespace bitr::vk
