// The application's own instance, device and queue: the library runs on them, beside whatever else they do.
#include <bitr/bitr.hpp>
#include <bitr/generate.hpp>
#include <bitr/vulkan.hpp>
#include <mutex>

#include "vulkan_app.hpp"

int main() {
  const VulkanApp app;
  // Taken around every submission of the library's; the application takes it around its own.
  std::mutex queue_mutex;
  const auto device = bitr::vk::adopt({.get_instance_proc_addr = vkGetInstanceProcAddr,
                                       .instance = app.instance,
                                       .physical_device = app.physical_device,
                                       .device = app.device,
                                       .queue = app.queue,
                                       .queue_family = app.queue_family,
                                       .timeline_semaphore_enabled = true,
                                       .lock_queue = [&] { queue_mutex.lock(); },
                                       .unlock_queue = [&] { queue_mutex.unlock(); }});
  if (!device) return std::fprintf(stderr, "%s\n", device.error().message.c_str()), 1;

  const auto pair = bitr::generate_pair("copy", {.points = 1024, .seed = 3});
  const auto model = bitr::untrained_model();
  if (!pair || !model) return 1;
  const std::vector<bitr::CloudPair> pairs = {{pair->source, pair->reference}};
  auto plan = bitr::make_plan(*device, *model, bitr::shape_of(pairs));
  if (!plan) return std::fprintf(stderr, "%s\n", plan.error().message.c_str()), 1;
  const auto assemblies = bitr::assemble(*plan, pairs, {.complete_match = true});
  if (!assemblies) return std::fprintf(stderr, "%s\n", assemblies.error().message.c_str()), 1;

  const double error =
      bitr::rotation_error_degrees(assemblies->front().T_reference_source, pair->T_reference_source);
  std::printf("on the application's %s: %.4f degrees from the truth\n", device->name().c_str(), error);
  return error < 0.1 ? 0 : 1;
}
