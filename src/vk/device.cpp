#include "vk/device.hpp"

#include <algorithm>
#include <cctype>
#include <charconv>

#include "core/failure.hpp"

namespace bitr::vk {
namespace {

const char* result_name(VkResult result) {
  switch (result) {
    case VK_ERROR_OUT_OF_HOST_MEMORY:
      return "out of host memory";
    case VK_ERROR_OUT_OF_DEVICE_MEMORY:
      return "out of device memory";
    case VK_ERROR_INITIALIZATION_FAILED:
      return "initialization failed";
    case VK_ERROR_LAYER_NOT_PRESENT:
      return "layer not present";
    case VK_ERROR_EXTENSION_NOT_PRESENT:
      return "extension not present";
    case VK_ERROR_INCOMPATIBLE_DRIVER:
      return "incompatible driver";
    case VK_ERROR_TOO_MANY_OBJECTS:
      return "too many objects";
    default:
      return nullptr;
  }
}

std::string lower(std::string text) {
  for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

// Real GPUs first, processors pretending to be one last.
int rank(VkPhysicalDeviceType type) {
  switch (type) {
    case VK_PHYSICAL_DEVICE_TYPE_DISCRETE_GPU:
      return 0;
    case VK_PHYSICAL_DEVICE_TYPE_INTEGRATED_GPU:
      return 1;
    case VK_PHYSICAL_DEVICE_TYPE_VIRTUAL_GPU:
      return 2;
    default:
      return 3;
  }
}

std::vector<VkPhysicalDevice> devices_of(const InstanceFunctions& vk, VkInstance instance) {
  std::uint32_t count = 0;
  check(vk.EnumeratePhysicalDevices(instance, &count, nullptr), "vkEnumeratePhysicalDevices");
  std::vector<VkPhysicalDevice> devices(count);
  check(vk.EnumeratePhysicalDevices(instance, &count, devices.data()), "vkEnumeratePhysicalDevices");
  devices.resize(count);
  return devices;
}

VkInstance make_instance(PFN_vkGetInstanceProcAddr get, const OwnDevice& wanted,
                         const VkDebugUtilsMessengerCreateInfoEXT* messenger) {
  const auto create = reinterpret_cast<PFN_vkCreateInstance>(get(nullptr, "vkCreateInstance"));
  if (!create) throw Failure(ErrorCode::no_device, "the Vulkan loader has no vkCreateInstance");
  std::vector<VkValidationFeatureEnableEXT> enabled;
  if (wanted.validate_synchronization)
    enabled.push_back(VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION_EXT);
  if (wanted.validate_on_gpu) {
    enabled.push_back(VK_VALIDATION_FEATURE_ENABLE_GPU_ASSISTED_EXT);
    enabled.push_back(VK_VALIDATION_FEATURE_ENABLE_GPU_ASSISTED_RESERVE_BINDING_SLOT_EXT);
  }
  const VkValidationFeaturesEXT features{
      .sType = VK_STRUCTURE_TYPE_VALIDATION_FEATURES_EXT,
      .pNext = messenger,
      .enabledValidationFeatureCount = static_cast<std::uint32_t>(enabled.size()),
      .pEnabledValidationFeatures = enabled.data(),
      .disabledValidationFeatureCount = 0,
      .pDisabledValidationFeatures = nullptr};
  const VkApplicationInfo application{.sType = VK_STRUCTURE_TYPE_APPLICATION_INFO,
                                      .pNext = nullptr,
                                      .pApplicationName = "bitr",
                                      .applicationVersion = 0,
                                      .pEngineName = "bitr",
                                      .engineVersion = 0,
                                      .apiVersion = VK_API_VERSION_1_2};
  const char* layer = "VK_LAYER_KHRONOS_validation";
  const char* extension = VK_EXT_DEBUG_UTILS_EXTENSION_NAME;
  const VkInstanceCreateInfo info{.sType = VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO,
                                  .pNext = wanted.validate ? &features : nullptr,
                                  .flags = 0,
                                  .pApplicationInfo = &application,
                                  .enabledLayerCount = wanted.validate ? 1u : 0u,
                                  .ppEnabledLayerNames = &layer,
                                  .enabledExtensionCount = wanted.validate ? 1u : 0u,
                                  .ppEnabledExtensionNames = &extension};
  VkInstance instance = VK_NULL_HANDLE;
  const VkResult result = create(&info, nullptr, &instance);
  if (result == VK_ERROR_LAYER_NOT_PRESENT)
    throw Failure(ErrorCode::unsupported, std::string(layer) + " is not installed");
  if (result == VK_ERROR_INCOMPATIBLE_DRIVER)
    throw Failure(ErrorCode::no_device, "no Vulkan driver is installed");
  check(result, "vkCreateInstance");
  return instance;
}

}  // namespace

void check(VkResult result, std::string_view what) {
  if (result >= 0) return;
  if (result == VK_ERROR_DEVICE_LOST)
    throw Failure(ErrorCode::device_lost, std::string(what) + ": the device was lost");
  const char* name = result_name(result);
  throw Failure(ErrorCode::internal,
                std::string(what) + ": " + (name ? name : "VkResult " + std::to_string(result)));
}

VkBool32 note_message(VkDebugUtilsMessageSeverityFlagBitsEXT, VkDebugUtilsMessageTypeFlagsEXT,
                      const VkDebugUtilsMessengerCallbackDataEXT* data, void* context) {
  const auto& self = *static_cast<const Context*>(context);
  const std::lock_guard lock(self.messages_mutex_);
  self.messages_.emplace_back(data->pMessage);
  return VK_FALSE;
}

Context::Context(const OwnDevice& wanted) : get_instance_proc_addr_(system_loader()) {
  try {
    create_instance(wanted);
    physical_device_ = choose(wanted.device);
    capabilities_ = capabilities_of(*instance_functions_, physical_device_);
    if (!capabilities_.unsuitable.empty())
      throw Failure(ErrorCode::no_device, capabilities_.name + ": " + capabilities_.unsuitable);
    capabilities_.choose(wanted.tier);
    queue_family_ = capabilities_.queue_family;
    create_device();
    instance_functions_->GetPhysicalDeviceMemoryProperties(physical_device_, &memory_);
    create_cache(wanted.pipeline_cache);
  } catch (...) {
    destroy();
    throw;
  }
}

Context::Context(const HostDevice& host)
    : get_instance_proc_addr_(host.get_instance_proc_addr),
      instance_functions_(std::make_unique<InstanceFunctions>(host.get_instance_proc_addr, host.instance)),
      own_(false),
      instance_(host.instance),
      physical_device_(host.physical_device),
      device_(host.device),
      queue_(host.queue),
      queue_family_(host.queue_family),
      allocation_(host.allocation),
      vk_(instance_functions_->GetDeviceProcAddr, host.device),
      capabilities_(capabilities_of(*instance_functions_, host.physical_device, host.subgroup_size_control)),
      lock_(host.lock),
      unlock_(host.unlock),
      cache_(host.pipeline_cache),
      own_cache_(host.pipeline_cache == VK_NULL_HANDLE) {
  if (!capabilities_.unsuitable.empty())
    throw Failure(ErrorCode::no_device, capabilities_.name + ": " + capabilities_.unsuitable);
  capabilities_.choose(host.tier);
  std::uint32_t count = 0;
  instance_functions_->GetPhysicalDeviceQueueFamilyProperties(physical_device_, &count, nullptr);
  std::vector<VkQueueFamilyProperties> families(count);
  instance_functions_->GetPhysicalDeviceQueueFamilyProperties(physical_device_, &count, families.data());
  if (queue_family_ >= count)
    throw Failure(ErrorCode::invalid_argument, "queue family " + std::to_string(queue_family_) +
                                                   ": the device has " + std::to_string(count));
  if (!(families[queue_family_].queueFlags & VK_QUEUE_COMPUTE_BIT))
    throw Failure(ErrorCode::invalid_argument,
                  "queue family " + std::to_string(queue_family_) + " has no compute");
  capabilities_.timestamp_bits = families[queue_family_].timestampValidBits;
  instance_functions_->GetPhysicalDeviceMemoryProperties(physical_device_, &memory_);
  if (own_cache_) create_cache({});
}

Context::~Context() { destroy(); }

void Context::destroy() noexcept {
  if (device_) {
    if (own_) vk_.DeviceWaitIdle(device_);
    for (auto& [key, pipeline] : pipelines_) vk_.DestroyPipeline(device_, pipeline.pipeline, allocation_);
    for (auto& [shader, layouts] : layouts_) {
      vk_.DestroyPipelineLayout(device_, layouts.layout, allocation_);
      vk_.DestroyDescriptorSetLayout(device_, layouts.set_layout, allocation_);
    }
    if (own_cache_ && cache_) vk_.DestroyPipelineCache(device_, cache_, allocation_);
    if (own_) vk_.DestroyDevice(device_, allocation_);
  }
  if (own_ && instance_) {
    if (messenger_) instance_functions_->DestroyDebugUtilsMessengerEXT(instance_, messenger_, nullptr);
    instance_functions_->DestroyInstance(instance_, nullptr);
  }
}

void Context::create_instance(const OwnDevice& wanted) {
  const VkDebugUtilsMessengerCreateInfoEXT messenger{
      .sType = VK_STRUCTURE_TYPE_DEBUG_UTILS_MESSENGER_CREATE_INFO_EXT,
      .pNext = nullptr,
      .flags = 0,
      .messageSeverity =
          VK_DEBUG_UTILS_MESSAGE_SEVERITY_WARNING_BIT_EXT | VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT,
      .messageType = VK_DEBUG_UTILS_MESSAGE_TYPE_VALIDATION_BIT_EXT,
      .pfnUserCallback = &note_message,
      .pUserData = this};
  instance_ = make_instance(get_instance_proc_addr_, wanted, &messenger);
  instance_functions_ = std::make_unique<InstanceFunctions>(get_instance_proc_addr_, instance_);
  if (wanted.validate && instance_functions_->CreateDebugUtilsMessengerEXT)
    check(instance_functions_->CreateDebugUtilsMessengerEXT(instance_, &messenger, nullptr, &messenger_),
          "vkCreateDebugUtilsMessengerEXT");
}

VkPhysicalDevice Context::choose(const std::string& wanted) {
  const auto devices = devices_of(*instance_functions_, instance_);
  if (devices.empty()) throw Failure(ErrorCode::no_device, "no Vulkan device is present");
  if (std::size_t index = 0;
      !wanted.empty() && std::from_chars(wanted.data(), wanted.data() + wanted.size(), index).ptr ==
                             wanted.data() + wanted.size()) {
    if (index >= devices.size())
      throw Failure(ErrorCode::no_device, "device " + wanted + ": there are " +
                                              std::to_string(devices.size()) + " Vulkan devices, 0 … " +
                                              std::to_string(devices.size() - 1));
    return devices[index];
  }
  VkPhysicalDevice best = VK_NULL_HANDLE;
  int best_rank = 4;
  std::string names, fault;
  for (VkPhysicalDevice device : devices) {
    const Capabilities c = capabilities_of(*instance_functions_, device);
    names += (names.empty() ? "" : ", ") + c.name;
    if (!wanted.empty() && lower(c.name).find(lower(wanted)) == std::string::npos) continue;
    if (!c.unsuitable.empty()) {
      fault = c.name + ": " + c.unsuitable;
      continue;
    }
    if (rank(c.type) < best_rank) {
      best = device;
      best_rank = rank(c.type);
    }
  }
  if (best) return best;
  if (!fault.empty()) throw Failure(ErrorCode::no_device, fault);
  throw Failure(ErrorCode::no_device, "no Vulkan device is called \"" + wanted + "\": there are " + names);
}

void Context::create_device() {
  const float priority = 1;
  const VkDeviceQueueCreateInfo queue{.sType = VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO,
                                      .pNext = nullptr,
                                      .flags = 0,
                                      .queueFamilyIndex = queue_family_,
                                      .queueCount = 1,
                                      .pQueuePriorities = &priority};
  VkPhysicalDeviceTimelineSemaphoreFeatures features{
      .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_TIMELINE_SEMAPHORE_FEATURES,
      .pNext = nullptr,
      .timelineSemaphore = VK_TRUE};
  VkPhysicalDeviceSubgroupSizeControlFeatures subgroups{
      .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SUBGROUP_SIZE_CONTROL_FEATURES,
      .pNext = nullptr,
      .subgroupSizeControl = capabilities_.size_control,
      .computeFullSubgroups = capabilities_.full_subgroups};
  const bool size_control = capabilities_.size_control || capabilities_.full_subgroups;
  if (size_control) features.pNext = &subgroups;
  const char* extension = VK_EXT_SUBGROUP_SIZE_CONTROL_EXTENSION_NAME;
  const VkDeviceCreateInfo info{.sType = VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO,
                                .pNext = &features,
                                .flags = 0,
                                .queueCreateInfoCount = 1,
                                .pQueueCreateInfos = &queue,
                                .enabledLayerCount = 0,
                                .ppEnabledLayerNames = nullptr,
                                .enabledExtensionCount = size_control ? 1u : 0u,
                                .ppEnabledExtensionNames = &extension,
                                .pEnabledFeatures = nullptr};
  check(instance_functions_->CreateDevice(physical_device_, &info, allocation_, &device_), "vkCreateDevice");
  vk_ = DeviceFunctions(instance_functions_->GetDeviceProcAddr, device_);
  vk_.GetDeviceQueue(device_, queue_family_, 0, &queue_);
}

void Context::note_lost(VkResult result) const {
  if (result == VK_ERROR_DEVICE_LOST) lost_ = true;
}

void Context::submit(VkCommandBuffer commands, VkSemaphore semaphore, std::uint64_t value) const {
  if (lost_) throw Failure(ErrorCode::device_lost, capabilities_.name + " was lost; create the device anew");
  const VkTimelineSemaphoreSubmitInfo timeline{.sType = VK_STRUCTURE_TYPE_TIMELINE_SEMAPHORE_SUBMIT_INFO,
                                               .pNext = nullptr,
                                               .waitSemaphoreValueCount = 0,
                                               .pWaitSemaphoreValues = nullptr,
                                               .signalSemaphoreValueCount = 1,
                                               .pSignalSemaphoreValues = &value};
  const VkSubmitInfo info{.sType = VK_STRUCTURE_TYPE_SUBMIT_INFO,
                          .pNext = &timeline,
                          .waitSemaphoreCount = 0,
                          .pWaitSemaphores = nullptr,
                          .pWaitDstStageMask = nullptr,
                          .commandBufferCount = 1,
                          .pCommandBuffers = &commands,
                          .signalSemaphoreCount = 1,
                          .pSignalSemaphores = &semaphore};
  VkResult result;
  {
    // Plans of other threads share the queue, and so may the host.
    const std::lock_guard guard(queue_mutex_);
    if (lock_) lock_();
    result = vk_.QueueSubmit(queue_, 1, &info, VK_NULL_HANDLE);
    if (unlock_) unlock_();
  }
  note_lost(result);
  check(result, "vkQueueSubmit");
}

void Context::wait(VkSemaphore semaphore, std::uint64_t value) const {
  const VkSemaphoreWaitInfo info{.sType = VK_STRUCTURE_TYPE_SEMAPHORE_WAIT_INFO,
                                 .pNext = nullptr,
                                 .flags = 0,
                                 .semaphoreCount = 1,
                                 .pSemaphores = &semaphore,
                                 .pValues = &value};
  const VkResult result = vk_.WaitSemaphores(device_, &info, UINT64_MAX);
  note_lost(result);
  check(result, "vkWaitSemaphores");
}

std::vector<std::string> Context::validation_messages() const {
  const std::lock_guard lock(messages_mutex_);
  return messages_;
}

std::vector<Capabilities> physical_devices() {
  const PFN_vkGetInstanceProcAddr get = system_loader();
  const VkInstance instance = make_instance(get, {}, nullptr);
  const InstanceFunctions vk(get, instance);
  std::vector<Capabilities> all;
  for (VkPhysicalDevice device : devices_of(vk, instance)) all.push_back(capabilities_of(vk, device));
  vk.DestroyInstance(instance, nullptr);
  return all;
}

}  // namespace bitr::vk
