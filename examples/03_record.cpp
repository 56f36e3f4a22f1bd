// A pass recorded into the application's command buffer: the clouds are on the device already, and a shader
// of the application's (transform.comp) moves the source by the pose, which never leaves the device.
#include <bitr/bitr.hpp>
#include <bitr/generate.hpp>
#include <bitr/vulkan.hpp>
#include <cmath>

#include "transform.hpp"
#include "vulkan_app.hpp"

namespace {

constexpr uint32_t points = 1024;

void fill(float* to, const bitr::PointCloud& cloud) {
  for (const bitr::Vec3d& p : cloud.positions)
    for (const double x : p) *to++ = static_cast<float>(x);
}

}  // namespace

int main() {
  const VulkanApp app;
  const auto device = bitr::vk::adopt({.get_instance_proc_addr = vkGetInstanceProcAddr,
                                       .instance = app.instance,
                                       .physical_device = app.physical_device,
                                       .device = app.device,
                                       .queue = app.queue,
                                       .queue_family = app.queue_family,
                                       .timeline_semaphore_enabled = true});
  if (!device) return std::fprintf(stderr, "%s\n", device.error().message.c_str()), 1;
  const auto pair = bitr::generate_pair("fragments", {.points = points, .seed = 3});
  const auto model = bitr::untrained_model();
  if (!pair || !model) return 1;
  // The plan's capacity is all the memory it will ever take; recording allocates none.
  auto plan = bitr::make_plan(*device, *model, {.pairs = 1, .points = 2 * points});
  if (!plan) return std::fprintf(stderr, "%s\n", plan.error().message.c_str()), 1;

  const auto source = app.make_buffer(3 * points), reference = app.make_buffer(3 * points);
  const auto poses = app.make_buffer(16), moved = app.make_buffer(3 * points);
  fill(source.data, pair->source);
  fill(reference.data, pair->reference);

  const VkCommandBuffer commands = app.begin_commands();
  const uint32_t sizes[] = {points};
  const auto recorded = bitr::vk::record(commands, *plan,
                                         {.source_positions = {source.buffer},
                                          .reference_positions = {reference.buffer},
                                          .source_sizes = sizes,
                                          .reference_sizes = sizes,
                                          .poses = {poses.buffer}});
  if (!recorded) return std::fprintf(stderr, "%s\n", recorded.error().message.c_str()), 1;

  // The pose is written by compute shaders: one barrier, and the application's shader may read it.
  VkMemoryBarrier barrier{};
  barrier.sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER;
  barrier.srcAccessMask = VK_ACCESS_SHADER_WRITE_BIT;
  barrier.dstAccessMask = VK_ACCESS_SHADER_READ_BIT;
  vkCmdPipelineBarrier(commands, VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT, VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT,
                       0, 1, &barrier, 0, nullptr, 0, nullptr);
  const TransformShader transform(app, poses.buffer, source.buffer, moved.buffer);
  transform.dispatch(commands, points);
  app.submit_and_wait(commands);

  // The same pair through assemble(), on the host's side.
  const std::vector<bitr::CloudPair> pairs = {{pair->source, pair->reference}};
  const auto assemblies = bitr::assemble(*plan, pairs, {.diagnostics = false});
  if (!assemblies) return std::fprintf(stderr, "%s\n", assemblies.error().message.c_str()), 1;
  double farthest = 0;
  for (uint32_t i = 0; i < points; ++i) {
    const bitr::Vec3d expected = assemblies->front().T_reference_source.apply(pair->source.positions[i]);
    for (uint32_t a = 0; a < 3; ++a)
      farthest = std::max(farthest, std::abs(expected[a] - static_cast<double>(moved.data[3 * i + a])));
  }
  std::printf("%s: points moved on the device are within %.1e of those moved on the host\n",
              device->name().c_str(), farthest);
  for (const auto& buffer : {source, reference, poses, moved}) app.free(buffer);
  return farthest < 1e-3 ? 0 : 1;
}
