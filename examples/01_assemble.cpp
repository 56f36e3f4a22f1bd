// Two clouds to a pose, on the best GPU there is or on the CPU.
#include <bitr/bitr.hpp>
#include <bitr/generate.hpp>
#include <cstdio>

int main() {
  // A solid and a moved copy of it, with the motion between them.
  const auto pair = bitr::generate_pair("copy", {.points = 2048, .seed = 7});
  // Untrained weights do for complete copies: f(X,Y)∘f(X,X) is exact for any weights.
  const auto model = bitr::untrained_model();
  if (!pair || !model) return 1;

  auto device = bitr::create_device();
  if (!device) {
    std::printf("no Vulkan (%s): on the CPU\n", device.error().message.c_str());
    device = bitr::cpu_device();
  }
  const std::vector<bitr::CloudPair> pairs = {{pair->source, pair->reference}};  // views
  auto plan = bitr::make_plan(*device, *model, bitr::shape_of(pairs));
  if (!plan) return std::fprintf(stderr, "%s\n", plan.error().message.c_str()), 1;
  const auto assemblies = bitr::assemble(*plan, pairs, {.complete_match = true});
  if (!assemblies) return std::fprintf(stderr, "%s\n", assemblies.error().message.c_str()), 1;

  const bitr::Assembly& assembly = assemblies->front();
  const double error = bitr::rotation_error_degrees(assembly.T_reference_source, pair->T_reference_source);
  std::printf("%s: %.4f degrees from the truth, overlap %.2f\n", device->name().c_str(), error,
              assembly.diagnostics.overlap.value_or(0));
  return error < 0.1 ? 0 : 1;
}
