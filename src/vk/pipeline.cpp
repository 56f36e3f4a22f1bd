// Pipelines and their cache.
#include <cstring>

#include "core/failure.hpp"
#include "core/hash.hpp"
#include "vk/device.hpp"

namespace bitr::vk {
namespace {

// The driver's blob goes behind a header of ours: a driver trusts what it is given.
struct CacheHeader {
  char magic[8] = {'b', 'i', 't', 'r', 'p', 'c', '0', '1'};
  std::uint64_t bytes = 0;
  std::uint64_t checksum = 0;
  std::uint8_t uuid[VK_UUID_SIZE] = {};
};

// The start of every driver's blob (VkPipelineCacheHeaderVersionOne).
struct DriverHeader {
  std::uint32_t size, version, vendor, device;
  std::uint8_t uuid[VK_UUID_SIZE];
};

// Whether a shader says that it has subgroup operations: capabilities come first of its instructions.
bool uses_subgroups(std::span<const std::uint32_t> spirv) {
  constexpr std::size_t header_words = 5;
  constexpr std::uint32_t op_capability = 2 << 16 | 17, group_non_uniform = 61, group_non_uniform_quad = 68;
  for (std::size_t at = header_words; at + 1 < spirv.size() && spirv[at] == op_capability; at += 2)
    if (spirv[at + 1] >= group_non_uniform && spirv[at + 1] <= group_non_uniform_quad) return true;
  return false;
}

}  // namespace

VkDescriptorType descriptor_type(Access access) {
  return access == Access::constant ? VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER
         : access == Access::texels ? VK_DESCRIPTOR_TYPE_UNIFORM_TEXEL_BUFFER
                                    : VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
}

const Pipeline& Context::find_pipeline(const Shader& shader,
                                       std::span<const std::uint32_t> specializations) const {
  const std::lock_guard lock(pipelines_mutex_);
  const std::pair key(&shader, std::vector<std::uint32_t>(specializations.begin(), specializations.end()));
  if (const auto found = pipelines_.find(key); found != pipelines_.end()) return found->second;
  if (specializations.size() != shader.specializations)
    throw Failure(ErrorCode::internal,
                  std::string(shader.name) + ": " + std::to_string(specializations.size()) +
                      " specialization constants for " + std::to_string(shader.specializations));

  if (!layouts_.count(&shader)) {
    std::vector<VkDescriptorSetLayoutBinding> bindings;
    for (std::uint32_t i = 0; i < shader.bindings.size(); ++i)
      bindings.push_back({.binding = i,
                          .descriptorType = descriptor_type(shader.bindings[i]),
                          .descriptorCount = 1,
                          .stageFlags = VK_SHADER_STAGE_COMPUTE_BIT,
                          .pImmutableSamplers = nullptr});
    const VkDescriptorSetLayoutCreateInfo set{.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO,
                                              .pNext = nullptr,
                                              .flags = 0,
                                              .bindingCount = static_cast<std::uint32_t>(bindings.size()),
                                              .pBindings = bindings.data()};
    Layouts layouts{};
    check(vk_.CreateDescriptorSetLayout(device_, &set, allocation_, &layouts.set_layout),
          "vkCreateDescriptorSetLayout");
    const VkPushConstantRange push{VK_SHADER_STAGE_COMPUTE_BIT, 0, shader.push_bytes};
    const VkPipelineLayoutCreateInfo info{.sType = VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO,
                                          .pNext = nullptr,
                                          .flags = 0,
                                          .setLayoutCount = 1,
                                          .pSetLayouts = &layouts.set_layout,
                                          .pushConstantRangeCount = shader.push_bytes ? 1u : 0u,
                                          .pPushConstantRanges = &push};
    const VkResult result = vk_.CreatePipelineLayout(device_, &info, allocation_, &layouts.layout);
    if (result != VK_SUCCESS) vk_.DestroyDescriptorSetLayout(device_, layouts.set_layout, allocation_);
    check(result, "vkCreatePipelineLayout");
    layouts_.emplace(&shader, layouts);
  }
  const Layouts& layouts = layouts_.at(&shader);

  const VkShaderModuleCreateInfo code{.sType = VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO,
                                      .pNext = nullptr,
                                      .flags = 0,
                                      .codeSize = shader.spirv.size_bytes(),
                                      .pCode = shader.spirv.data()};
  VkShaderModule module = VK_NULL_HANDLE;
  check(vk_.CreateShaderModule(device_, &code, allocation_, &module), "vkCreateShaderModule");
  std::vector<VkSpecializationMapEntry> entries;
  for (std::uint32_t i = 0; i < specializations.size(); ++i)
    entries.push_back({i, static_cast<std::uint32_t>(i * sizeof(std::uint32_t)), sizeof(std::uint32_t)});
  const VkSpecializationInfo constants{static_cast<std::uint32_t>(entries.size()), entries.data(),
                                       specializations.size_bytes(), specializations.data()};
  const VkPipelineShaderStageRequiredSubgroupSizeCreateInfo subgroups{
      .sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_REQUIRED_SUBGROUP_SIZE_CREATE_INFO,
      .pNext = nullptr,
      .requiredSubgroupSize = capabilities_.required_subgroup};
  const bool shares = uses_subgroups(shader.spirv);
  const bool sized = shares && capabilities_.required_subgroup > 0;
  VkPipelineShaderStageCreateFlags flags = 0;
  // Work groups are whole subgroups, all of which take part; sizes of both are powers of two.
  const std::uint32_t size = sized ? capabilities_.required_subgroup : capabilities_.subgroup_size;
  if (shares && capabilities_.full_subgroups && specializations[0] % size == 0)
    flags |= VK_PIPELINE_SHADER_STAGE_CREATE_REQUIRE_FULL_SUBGROUPS_BIT;
  const VkComputePipelineCreateInfo info{
      .sType = VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO,
      .pNext = nullptr,
      .flags = 0,
      .stage = {.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO,
                .pNext = sized ? &subgroups : nullptr,
                .flags = flags,
                .stage = VK_SHADER_STAGE_COMPUTE_BIT,
                .module = module,
                .pName = "main",
                .pSpecializationInfo = &constants},
      .layout = layouts.layout,
      .basePipelineHandle = VK_NULL_HANDLE,
      .basePipelineIndex = -1};
  Pipeline made{&shader, VK_NULL_HANDLE, layouts.layout, layouts.set_layout};
  const VkResult result = vk_.CreateComputePipelines(device_, cache_, 1, &info, allocation_, &made.pipeline);
  vk_.DestroyShaderModule(device_, module, allocation_);
  check(result, std::string("vkCreateComputePipelines of ") + shader.name);
  return pipelines_.emplace(key, made).first->second;
}

std::size_t Context::pipeline_count() const {
  const std::lock_guard lock(pipelines_mutex_);
  return pipelines_.size();
}

std::set<std::string> Context::shaders() const {
  const std::lock_guard lock(pipelines_mutex_);
  std::set<std::string> names;
  for (const auto& [key, pipeline] : pipelines_) names.insert(pipeline.shader->name);
  return names;
}

void Context::create_cache(std::span<const std::byte> blob) {
  VkPhysicalDeviceProperties2 properties{
      .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2, .pNext = nullptr, .properties = {}};
  instance_functions_->GetPhysicalDeviceProperties2(physical_device_, &properties);
  const VkPhysicalDeviceProperties& p = properties.properties;
  // A blob of another device, driver or version is of no use, but no error either: pipelines are made anew.
  std::span<const std::byte> usable;
  CacheHeader header;
  if (blob.size() >= sizeof header) {
    std::memcpy(&header, blob.data(), sizeof header);
    const auto body = blob.subspan(sizeof header);
    DriverHeader driver;
    if (std::memcmp(header.magic, CacheHeader{}.magic, sizeof header.magic) == 0 &&
        header.bytes == body.size() && header.checksum == fnv1a(body) &&
        std::memcmp(header.uuid, p.pipelineCacheUUID, VK_UUID_SIZE) == 0 && body.size() >= sizeof driver) {
      std::memcpy(&driver, body.data(), sizeof driver);
      if (driver.size >= sizeof driver && driver.version == VK_PIPELINE_CACHE_HEADER_VERSION_ONE &&
          driver.vendor == p.vendorID && driver.device == p.deviceID &&
          std::memcmp(driver.uuid, p.pipelineCacheUUID, VK_UUID_SIZE) == 0)
        usable = body;
    }
  }
  const VkPipelineCacheCreateInfo info{.sType = VK_STRUCTURE_TYPE_PIPELINE_CACHE_CREATE_INFO,
                                       .pNext = nullptr,
                                       .flags = 0,
                                       .initialDataSize = usable.size(),
                                       .pInitialData = usable.data()};
  check(vk_.CreatePipelineCache(device_, &info, allocation_, &cache_), "vkCreatePipelineCache");
}

std::vector<std::byte> Context::pipeline_cache() const {
  std::size_t size = 0;
  check(vk_.GetPipelineCacheData(device_, cache_, &size, nullptr), "vkGetPipelineCacheData");
  if (size < sizeof(DriverHeader)) return {};
  CacheHeader header;
  std::vector<std::byte> blob(sizeof header + size);
  check(vk_.GetPipelineCacheData(device_, cache_, &size, blob.data() + sizeof header),
        "vkGetPipelineCacheData");
  blob.resize(sizeof header + size);
  const auto body = std::span<const std::byte>(blob).subspan(sizeof header);
  DriverHeader driver;
  std::memcpy(&driver, body.data(), sizeof driver);
  header.bytes = body.size();
  header.checksum = fnv1a(body);
  std::memcpy(header.uuid, driver.uuid, VK_UUID_SIZE);
  std::memcpy(blob.data(), &header, sizeof header);
  return blob;
}

}  // namespace bitr::vk
