// The application's compute shader transform.comp, bound to three buffers.
#pragma once

#include "vulkan_app.hpp"

class TransformShader {
 public:
  TransformShader(const VulkanApp& app, VkBuffer pose, VkBuffer points, VkBuffer moved) : app_(app) {
    static constexpr uint32_t code[] = {
#include "transform.spv.inc"
    };
    VkShaderModuleCreateInfo module_info{};
    module_info.sType = VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO;
    module_info.codeSize = sizeof code;
    module_info.pCode = code;
    VkShaderModule module;
    require(vkCreateShaderModule(app.device, &module_info, nullptr, &module), "vkCreateShaderModule");

    VkDescriptorSetLayoutBinding bindings[3]{};
    for (uint32_t i = 0; i < 3; ++i)
      bindings[i] = {i, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 1, VK_SHADER_STAGE_COMPUTE_BIT, nullptr};
    VkDescriptorSetLayoutCreateInfo set_info{};
    set_info.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO;
    set_info.bindingCount = 3;
    set_info.pBindings = bindings;
    require(vkCreateDescriptorSetLayout(app.device, &set_info, nullptr, &set_layout_),
            "vkCreateDescriptorSetLayout");
    const VkPushConstantRange push{VK_SHADER_STAGE_COMPUTE_BIT, 0, sizeof(uint32_t)};
    VkPipelineLayoutCreateInfo layout_info{};
    layout_info.sType = VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO;
    layout_info.setLayoutCount = 1;
    layout_info.pSetLayouts = &set_layout_;
    layout_info.pushConstantRangeCount = 1;
    layout_info.pPushConstantRanges = &push;
    require(vkCreatePipelineLayout(app.device, &layout_info, nullptr, &layout_), "vkCreatePipelineLayout");
    VkComputePipelineCreateInfo pipeline_info{};
    pipeline_info.sType = VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO;
    pipeline_info.stage.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
    pipeline_info.stage.stage = VK_SHADER_STAGE_COMPUTE_BIT;
    pipeline_info.stage.module = module;
    pipeline_info.stage.pName = "main";
    pipeline_info.layout = layout_;
    require(vkCreateComputePipelines(app.device, VK_NULL_HANDLE, 1, &pipeline_info, nullptr, &pipeline_),
            "vkCreateComputePipelines");
    vkDestroyShaderModule(app.device, module, nullptr);

    const VkDescriptorPoolSize size{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 3};
    VkDescriptorPoolCreateInfo pool_info{};
    pool_info.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO;
    pool_info.maxSets = 1;
    pool_info.poolSizeCount = 1;
    pool_info.pPoolSizes = &size;
    require(vkCreateDescriptorPool(app.device, &pool_info, nullptr, &pool_), "vkCreateDescriptorPool");
    VkDescriptorSetAllocateInfo allocate{};
    allocate.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO;
    allocate.descriptorPool = pool_;
    allocate.descriptorSetCount = 1;
    allocate.pSetLayouts = &set_layout_;
    require(vkAllocateDescriptorSets(app.device, &allocate, &set_), "vkAllocateDescriptorSets");
    const VkDescriptorBufferInfo buffers[] = {
        {pose, 0, VK_WHOLE_SIZE}, {points, 0, VK_WHOLE_SIZE}, {moved, 0, VK_WHOLE_SIZE}};
    VkWriteDescriptorSet write{};
    write.sType = VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET;
    write.dstSet = set_;
    write.descriptorCount = 3;
    write.descriptorType = VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
    write.pBufferInfo = buffers;
    vkUpdateDescriptorSets(app.device, 1, &write, 0, nullptr);
  }
  TransformShader(const TransformShader&) = delete;
  TransformShader& operator=(const TransformShader&) = delete;
  ~TransformShader() {
    vkDestroyDescriptorPool(app_.device, pool_, nullptr);
    vkDestroyPipeline(app_.device, pipeline_, nullptr);
    vkDestroyPipelineLayout(app_.device, layout_, nullptr);
    vkDestroyDescriptorSetLayout(app_.device, set_layout_, nullptr);
  }

  void dispatch(VkCommandBuffer commands, uint32_t count) const {
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline_);
    vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_COMPUTE, layout_, 0, 1, &set_, 0, nullptr);
    vkCmdPushConstants(commands, layout_, VK_SHADER_STAGE_COMPUTE_BIT, 0, sizeof count, &count);
    vkCmdDispatch(commands, (count + 63) / 64, 1, 1);
  }

 private:
  const VulkanApp& app_;
  VkDescriptorSetLayout set_layout_ = VK_NULL_HANDLE;
  VkPipelineLayout layout_ = VK_NULL_HANDLE;
  VkPipeline pipeline_ = VK_NULL_HANDLE;
  VkDescriptorPool pool_ = VK_NULL_HANDLE;
  VkDescriptorSet set_ = VK_NULL_HANDLE;
};
