#include "vk/schedule.hpp"

#include <algorithm>

#include "core/failure.hpp"
#include "core/random.hpp"

namespace bitr::vk {
namespace {

bool conflict(const Dispatch& earlier, const Dispatch& later) {
  for (std::size_t i = 0; i < earlier.ranges.size(); ++i)
    for (std::size_t j = 0; j < later.ranges.size(); ++j)
      if ((earlier.writes(i) || later.writes(j)) && earlier.ranges[i].overlaps(later.ranges[j])) return true;
  return false;
}

}  // namespace

bool Dispatch::writes(std::size_t i) const {
  if (!pipeline) return i == 1;
  const Access access = pipeline->shader->bindings[i];
  return access == Access::write || access == Access::modify;
}

void Schedule::add(Dispatch work) {
  const Shader& shader = *work.pipeline->shader;
  if (work.ranges.size() != shader.bindings.size())
    throw Failure(ErrorCode::internal, std::string(shader.name) + ": " + std::to_string(work.ranges.size()) +
                                           " ranges for " + std::to_string(shader.bindings.size()) +
                                           " bindings");
  if (const std::uint32_t most = *std::max_element(work.groups.begin(), work.groups.end());
      most > most_groups_)
    throw Failure(ErrorCode::internal, std::string(shader.name) + ": " + std::to_string(most) +
                                           " work groups along an axis, at most " +
                                           std::to_string(most_groups_) + " fit");
  if (work.groups[0] == 0 || work.groups[1] == 0 || work.groups[2] == 0) return;
  dispatches_.push_back(std::move(work));
}

void Schedule::copy(const Range& from, const Range& to) {
  dispatches_.push_back({nullptr, {from, to}, {}, {1, 1, 1}, 0, node_});
}

void Schedule::shuffle(std::uint64_t seed) {
  Random random(seed);
  std::vector<Dispatch> ordered;
  std::vector<std::size_t> waiting(dispatches_.size(), 0);  // earlier dispatches each still waits for
  std::vector<std::vector<std::size_t>> followers(dispatches_.size());
  for (std::size_t later = 0; later < dispatches_.size(); ++later)
    for (std::size_t earlier = 0; earlier < later; ++earlier)
      if (conflict(dispatches_[earlier], dispatches_[later])) {
        followers[earlier].push_back(later);
        ++waiting[later];
      }
  std::vector<std::size_t> ready;
  for (std::size_t i = 0; i < dispatches_.size(); ++i)
    if (waiting[i] == 0) ready.push_back(i);
  while (!ready.empty()) {
    std::swap(ready[random.below(ready.size())], ready.back());
    const std::size_t next = ready.back();
    ready.pop_back();
    ordered.push_back(dispatches_[next]);
    for (std::size_t follower : followers[next])
      if (--waiting[follower] == 0) ready.push_back(follower);
  }
  dispatches_ = std::move(ordered);
}

Recorder::~Recorder() {
  destroy_views();
  if (pool_) context_.vk().DestroyDescriptorPool(context_.device(), pool_, context_.allocation());
}

void Recorder::destroy_views() {
  for (const auto& [range, view] : views_)
    context_.vk().DestroyBufferView(context_.device(), view, context_.allocation());
  views_.clear();
}

VkBufferView Recorder::view(const Range& range) {
  VkBufferView& view = views_[{range.buffer, range.offset, range.size}];
  if (view) return view;
  const VkBufferViewCreateInfo info{.sType = VK_STRUCTURE_TYPE_BUFFER_VIEW_CREATE_INFO,
                                    .pNext = nullptr,
                                    .flags = 0,
                                    .buffer = range.buffer,
                                    .format = VK_FORMAT_R32G32B32A32_SFLOAT,
                                    .offset = range.offset,
                                    .range = range.size / 16 * 16};
  check(context_.vk().CreateBufferView(context_.device(), &info, context_.allocation(), &view),
        "vkCreateBufferView");
  return view;
}

void Recorder::bind(const Schedule& schedule) {
  const DeviceFunctions& vk = context_.vk();
  destroy_views();
  std::uint32_t sets = 0, storage = 0, uniform = 0, texels = 0;
  for (const Dispatch& work : schedule.dispatches()) {
    if (!work.pipeline) continue;
    ++sets;
    for (const Access access : work.pipeline->shader->bindings)
      ++(access == Access::constant ? uniform : access == Access::texels ? texels : storage);
  }
  if (sets > pool_sets_ || storage > pool_storage_ || uniform > pool_uniform_ || texels > pool_texels_) {
    if (pool_) vk.DestroyDescriptorPool(context_.device(), pool_, context_.allocation());
    pool_ = VK_NULL_HANDLE;
    pool_sets_ = std::max(sets, pool_sets_);
    pool_storage_ = std::max(storage, pool_storage_);
    pool_uniform_ = std::max(uniform, pool_uniform_);
    pool_texels_ = std::max(texels, pool_texels_);
    const VkDescriptorPoolSize sizes[] = {
        {VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, std::max(pool_storage_, 1u)},
        {VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER, std::max(pool_uniform_, 1u)},
        {VK_DESCRIPTOR_TYPE_UNIFORM_TEXEL_BUFFER, std::max(pool_texels_, 1u)}};
    const VkDescriptorPoolCreateInfo info{.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO,
                                          .pNext = nullptr,
                                          .flags = 0,
                                          .maxSets = pool_sets_,
                                          .poolSizeCount = 3,
                                          .pPoolSizes = sizes};
    check(vk.CreateDescriptorPool(context_.device(), &info, context_.allocation(), &pool_),
          "vkCreateDescriptorPool");
  } else if (pool_) {
    check(vk.ResetDescriptorPool(context_.device(), pool_, 0), "vkResetDescriptorPool");
  }

  sets_.assign(schedule.dispatches().size(), VK_NULL_HANDLE);
  for (std::size_t w = 0; w < schedule.dispatches().size(); ++w) {
    const Dispatch& work = schedule.dispatches()[w];
    if (!work.pipeline) continue;
    const VkDescriptorSetAllocateInfo allocate{.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO,
                                               .pNext = nullptr,
                                               .descriptorPool = pool_,
                                               .descriptorSetCount = 1,
                                               .pSetLayouts = &work.pipeline->set_layout};
    check(vk.AllocateDescriptorSets(context_.device(), &allocate, &sets_[w]), "vkAllocateDescriptorSets");
    std::vector<VkDescriptorBufferInfo> buffers;
    std::vector<VkBufferView> views;
    std::vector<VkWriteDescriptorSet> writes;
    buffers.reserve(work.ranges.size());
    views.reserve(work.ranges.size());
    for (std::uint32_t i = 0; i < work.ranges.size(); ++i) {
      const Range& range = work.ranges[i];
      const Access access = work.pipeline->shader->bindings[i];
      const Capabilities& c = context_.capabilities();
      if (const std::uint64_t most = access == Access::constant ? c.uniform_range : c.storage_range;
          range.size > most)
        throw Failure(ErrorCode::invalid_argument,
                      std::string(work.name()) + ": binding " + std::to_string(i) + " needs " +
                          std::to_string(range.size) + " bytes, " + c.name + " binds at most " +
                          std::to_string(most) + ": give it smaller clouds or fewer pairs at once");
      buffers.push_back({range.buffer, range.offset, range.size});
      views.push_back(access == Access::texels ? view(range) : VK_NULL_HANDLE);
      writes.push_back({.sType = VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET,
                        .pNext = nullptr,
                        .dstSet = sets_[w],
                        .dstBinding = i,
                        .dstArrayElement = 0,
                        .descriptorCount = 1,
                        .descriptorType = descriptor_type(access),
                        .pImageInfo = nullptr,
                        .pBufferInfo = &buffers.back(),
                        .pTexelBufferView = &views.back()});
    }
    vk.UpdateDescriptorSets(context_.device(), static_cast<std::uint32_t>(writes.size()), writes.data(), 0,
                            nullptr);
  }
}

bool Recorder::conflicts(const Dispatch& work) const {
  for (std::size_t i = 0; i < work.ranges.size(); ++i)
    for (const Touched& touched : pending_)
      if ((touched.written || work.writes(i)) && touched.range.overlaps(work.ranges[i])) return true;
  return false;
}

void Recorder::barrier(VkCommandBuffer commands) {
  const DeviceFunctions& vk = context_.vk();
  constexpr VkPipelineStageFlags stages =
      VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT | VK_PIPELINE_STAGE_TRANSFER_BIT;
  constexpr VkAccessFlags written = VK_ACCESS_SHADER_WRITE_BIT | VK_ACCESS_TRANSFER_WRITE_BIT;
  constexpr VkAccessFlags read =
      VK_ACCESS_SHADER_READ_BIT | VK_ACCESS_TRANSFER_READ_BIT | VK_ACCESS_UNIFORM_READ_BIT;
  const VkMemoryBarrier memory{.sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER,
                               .pNext = nullptr,
                               .srcAccessMask = written,
                               .dstAccessMask = written | read};
  vk.CmdPipelineBarrier(commands, stages, stages, 0, 1, &memory, 0, nullptr, 0, nullptr);
  pending_.clear();
  ++counters_.barriers;
}

void Recorder::show_host(VkCommandBuffer commands) const {
  const VkMemoryBarrier memory{.sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER,
                               .pNext = nullptr,
                               .srcAccessMask = VK_ACCESS_TRANSFER_WRITE_BIT,
                               .dstAccessMask = VK_ACCESS_HOST_READ_BIT};
  context_.vk().CmdPipelineBarrier(commands, VK_PIPELINE_STAGE_TRANSFER_BIT, VK_PIPELINE_STAGE_HOST_BIT, 0, 1,
                                   &memory, 0, nullptr, 0, nullptr);
}

void Recorder::record(VkCommandBuffer commands, const Schedule& schedule, std::size_t begin, std::size_t end,
                      const Options& options) {
  const DeviceFunctions& vk = context_.vk();
  const auto stamp = [&](int node, std::uint32_t which) {
    if (options.timestamps && node >= 0)
      vk.CmdWriteTimestamp(commands, VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT, options.timestamps,
                           2 * static_cast<std::uint32_t>(node) + which);
  };
  const auto& dispatches = schedule.dispatches();
  for (std::size_t w = begin; w < end; ++w) {
    const Dispatch& work = dispatches[w];
    if (conflicts(work) || (options.barriers == Barriers::after_all_work && w > 0)) barrier(commands);
    for (std::size_t i = 0; i < work.ranges.size(); ++i) pending_.push_back({work.ranges[i], work.writes(i)});

    if (!work.pipeline) {
      const VkBufferCopy region{work.ranges[0].offset, work.ranges[1].offset, work.ranges[0].size};
      vk.CmdCopyBuffer(commands, work.ranges[0].buffer, work.ranges[1].buffer, 1, &region);
      ++counters_.copies;
      continue;
    }
    if (w == 0 || dispatches[w - 1].node != work.node) stamp(work.node, 0);
    vk.CmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, work.pipeline->pipeline);
    vk.CmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_COMPUTE, work.pipeline->layout, 0, 1, &sets_[w],
                             0, nullptr);
    if (const std::uint32_t bytes = work.pipeline->shader->push_bytes)
      vk.CmdPushConstants(commands, work.pipeline->layout, VK_SHADER_STAGE_COMPUTE_BIT, 0, bytes,
                          work.push.data());
    vk.CmdDispatch(commands, work.groups[0], work.groups[1], work.groups[2]);
    ++counters_.dispatches;
    if (w + 1 == dispatches.size() || dispatches[w + 1].node != work.node) stamp(work.node, 1);
  }
}

}  // namespace bitr::vk
