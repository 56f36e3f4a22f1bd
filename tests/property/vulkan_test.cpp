// Plans on a Vulkan device beyond what the CPU's promise too: profiles, prewarming, and failures of the
// driver, which are simulated by putting functions that fail in place of its own.
#include <gmock/gmock.h>

#include <algorithm>
#include <bitr/vulkan.hpp>
#include <limits>
#include <nlohmann/json.hpp>

#include "api/internal.hpp"
#include "property/network.hpp"
#include "vk/commands.hpp"

namespace bitr {
namespace {

using test::exact_cloud;
using test::ExactCloud;
using testing::AllOf;
using testing::HasSubstr;

class VulkanPlan : public testing::Test {
 protected:
  void SetUp() override { BITR_NEEDS(Backend::vulkan); }
  Result<Plan> plan(const Device& device) const { return make_plan(device, model_, {1, 200}); }
  CloudPair pair() const { return {source_.view(), reference_.view()}; }
  Random random_{6};
  const Model model_ = untrained_model().value();
  const ExactCloud source_ = exact_cloud(random_, 60), reference_ = exact_cloud(random_, 75);
};

TEST_F(VulkanPlan, OnlyRunsTheFoldedNetworkInSinglePrecision) {
  const Device device = test::device_on(Backend::vulkan);
  const auto f64 = make_plan(device, model_, {1, 200}, {.precision = Precision::f64});
  ASSERT_FALSE(f64);
  EXPECT_EQ(f64.error().code, ErrorCode::unsupported);
  EXPECT_THAT(f64.error().message, AllOf(HasSubstr("f64"), HasSubstr(device.name())));
  const auto as_defined = make_plan(device, model_, {1, 200}, {.as_defined = true});
  ASSERT_FALSE(as_defined);
  EXPECT_EQ(as_defined.error().code, ErrorCode::unsupported);
  EXPECT_THAT(as_defined.error().message, HasSubstr("as defined"));
}

TEST_F(VulkanPlan, KnowsItsDeviceItsMemoryAndItsWork) {
  const Device device = test::device_on(Backend::vulkan);
  EXPECT_EQ(device.backend(), Backend::vulkan);
  EXPECT_FALSE(device.driver().empty());
  auto plan = this->plan(device);
  ASSERT_TRUE(plan) << plan.error().message;
  EXPECT_EQ(plan->device().name(), device.name());
  const std::size_t bytes = plan->workspace_bytes();
  EXPECT_GT(bytes, 0u);
  ASSERT_TRUE(assemble(*plan, {{pair()}}));
  EXPECT_EQ(plan->workspace_bytes(), bytes);
  EXPECT_GE(plan->counters().dispatches, plan->operation_count());
  EXPECT_GT(plan->counters().barriers, 0u);
  EXPECT_EQ(plan->counters().submissions, 1u);
  EXPECT_GT(Internal::context(device)->pipeline_count(), 0u);
}

TEST_F(VulkanPlan, ProfileIsInOrderAndSumsUpToTheTimings) {
  auto plan = this->plan(test::device_on(Backend::vulkan));
  ASSERT_TRUE(plan);
  ASSERT_TRUE(assemble(*plan, {{pair()}}, {.complete_match = true, .swap_residual = true}));
  const auto& profile = plan->profile();
  ASSERT_EQ(profile.size(), 3 * plan->operation_count());
  double sum = 0, expected = 0;
  for (std::size_t i = 0; i < profile.size(); ++i) {
    EXPECT_EQ(profile[i].pass, i / plan->operation_count());
    EXPECT_GE(profile[i].milliseconds, 0);
    if (i > 0) {
      EXPECT_GE(profile[i].start_ms, profile[i - 1].start_ms);
    }
    sum += profile[i].milliseconds;
  }
  for (const StageTime& stage : plan->timings()) expected += stage.milliseconds;
  EXPECT_NEAR(sum, expected, 1e-9 * sum);
  const auto trace = nlohmann::json::parse(chrome_trace(*plan));
  std::size_t spans = 0;
  for (const auto& event : trace["traceEvents"]) spans += event["ph"] == "X";
  EXPECT_EQ(spans, profile.size() + 3);
  EXPECT_EQ(trace["otherData"]["backend"], "vulkan");
}

TEST_F(VulkanPlan, PrewarmingChangesNothingButTheFirstRun) {
  const Device device = test::device_on(Backend::vulkan);
  auto cold = plan(device), warm = plan(device);
  ASSERT_TRUE(cold && warm);
  const auto done = prewarm(*warm);
  ASSERT_TRUE(done) << done.error().message;
  EXPECT_TRUE(warm->timings().empty());
  EXPECT_EQ(test::solve(*warm, source_.view(), reference_.view()).T_reference_source.rotation,
            test::solve(*cold, source_.view(), reference_.view()).T_reference_source.rotation);
  auto small = make_plan(device, model_, {1, 49});
  ASSERT_TRUE(small);
  const auto refused = prewarm(*small);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().message, AllOf(HasSubstr("49 points"), HasSubstr("50")));
}

TEST_F(VulkanPlan, SearchesNeighboursAsItIsTold) {
  const Device device = test::device_on(Backend::vulkan);
  std::vector<Assembly> found;
  std::vector<std::size_t> dispatches;
  for (const NeighborSearch neighbors :
       {NeighborSearch::automatic, NeighborSearch::brute_force, NeighborSearch::tree}) {
    auto plan = make_plan(device, model_, {1, 200}, {.neighbors = neighbors});
    ASSERT_TRUE(plan) << plan.error().message;
    found.push_back(test::solve(*plan, source_.view(), reference_.view()));
    dispatches.push_back(plan->counters().dispatches);
  }
  for (const Assembly& assembly : found) {
    EXPECT_EQ(assembly.T_reference_source.rotation, found[0].T_reference_source.rotation);
    EXPECT_EQ(assembly.T_reference_source.translation, found[0].T_reference_source.translation);
  }
  EXPECT_EQ(dispatches[0], dispatches[1]);
  EXPECT_GT(dispatches[2], dispatches[1]);
}

TEST_F(VulkanPlan, SavesAndTakesItsPipelineCache) {
  const auto first = create_device();
  ASSERT_TRUE(first) << first.error().message;
  auto plan = this->plan(*first);
  ASSERT_TRUE(plan);
  const Assembly expected = test::solve(*plan, source_.view(), reference_.view());
  const auto second = create_device({.pipeline_cache = first->pipeline_cache()});
  ASSERT_TRUE(second) << second.error().message;
  auto again = this->plan(*second);
  ASSERT_TRUE(again);
  EXPECT_EQ(test::solve(*again, source_.view(), reference_.view()).T_reference_source.rotation,
            expected.T_reference_source.rotation);
}

// The application's clouds in buffers of its own, at any stride, in a command buffer of its own.
TEST_F(VulkanPlan, RecordedByAnApplicationGivesTheSamePose) {
  const Device device = test::device_on(Backend::vulkan);
  auto plan = this->plan(device);
  ASSERT_TRUE(plan) << plan.error().message;
  const Pose expected = test::solve(*plan, source_.view(), reference_.view()).T_reference_source;
  const vk::Context& context = *Internal::context(device);
  for (const std::uint32_t stride : {3u, 5u}) {
    SCOPED_TRACE(stride);
    // Nothing between the points may be read.
    const auto uploaded = [&](const ExactCloud& cloud) {
      const std::size_t count = cloud.positions.size() * stride;
      vk::Buffer buffer(context, count * sizeof(float), true);
      auto* numbers = reinterpret_cast<float*>(buffer.data());
      std::fill_n(numbers, count, std::numeric_limits<float>::quiet_NaN());
      for (std::size_t i = 0; i < cloud.positions.size(); ++i)
        for (std::size_t a = 0; a < 3; ++a)
          numbers[i * stride + a] = static_cast<float>(cloud.positions[i][a]);
      return buffer;
    };
    const vk::Buffer source = uploaded(source_), reference = uploaded(reference_);
    const vk::Buffer poses(context, 16 * sizeof(float), true);
    const std::uint32_t source_sizes[] = {60}, reference_sizes[] = {75};
    vk::Commands commands(context);
    const VkCommandBuffer recording = commands.buffers(1).front();
    commands.begin(recording);
    const auto recorded = vk::record(recording, *plan,
                                     {.source_positions = {source.handle()},
                                      .reference_positions = {reference.handle()},
                                      .position_stride = stride,
                                      .source_sizes = source_sizes,
                                      .reference_sizes = reference_sizes,
                                      .poses = {poses.handle()}});
    ASSERT_TRUE(recorded) << recorded.error().message;
    const VkMemoryBarrier written{.sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER,
                                  .pNext = nullptr,
                                  .srcAccessMask = VK_ACCESS_SHADER_WRITE_BIT,
                                  .dstAccessMask = VK_ACCESS_HOST_READ_BIT};
    context.vk().CmdPipelineBarrier(recording, VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT,
                                    VK_PIPELINE_STAGE_HOST_BIT, 0, 1, &written, 0, nullptr, 0, nullptr);
    commands.end(recording);
    commands.submit(recording);
    commands.wait();
    const std::span<const float> m(reinterpret_cast<const float*>(poses.data()), 16);
    const Pose found{{m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]}, {m[3], m[7], m[11]}};
    EXPECT_LE(rotation_error_degrees(found, expected), 0.05);
    EXPECT_LE(translation_error(found, expected), 1e-3);
    EXPECT_THAT(m.subspan(12), testing::ElementsAre(0, 0, 0, 1));
  }
}

// The driver's own functions, while a device has failing ones in their place.
PFN_vkWaitSemaphores real_wait = nullptr;

VkResult VKAPI_CALL lose_on_submit(VkQueue, std::uint32_t, const VkSubmitInfo*, VkFence) {
  return VK_ERROR_DEVICE_LOST;
}
// The work is let finish first, so that nothing is in use when the plan is destroyed.
VkResult VKAPI_CALL lose_on_wait(VkDevice device, const VkSemaphoreWaitInfo* info, std::uint64_t timeout) {
  real_wait(device, info, timeout);
  return VK_ERROR_DEVICE_LOST;
}
VkResult VKAPI_CALL no_memory(VkDevice, const VkMemoryAllocateInfo*, const VkAllocationCallbacks*,
                              VkDeviceMemory*) {
  return VK_ERROR_OUT_OF_DEVICE_MEMORY;
}

class DriverFailure : public VulkanPlan {
 protected:
  void expect_a_new_device_works() {
    const auto device = create_device();
    ASSERT_TRUE(device) << device.error().message;
    auto plan = this->plan(*device);
    ASSERT_TRUE(plan) << plan.error().message;
    const auto assemblies = assemble(*plan, {{pair()}});
    ASSERT_TRUE(assemblies) << assemblies.error().message;
    EXPECT_NE(assemblies->front().status, Status::failed);
  }
  // A plan whose device is lost at the next assemble().
  void expect_lost(void (*lose)(vk::DeviceFunctions&)) {
    const auto device = create_device();
    ASSERT_TRUE(device) << device.error().message;
    auto plan = this->plan(*device);
    ASSERT_TRUE(plan) << plan.error().message;
    const std::string last = plan->operation_count() > 0 ? "pose" : "";
    lose(Internal::context(*device)->functions());
    const auto lost = assemble(*plan, {{pair()}});
    ASSERT_FALSE(lost);
    EXPECT_EQ(lost.error().code, ErrorCode::device_lost);
    EXPECT_THAT(lost.error().message, AllOf(HasSubstr("lost"), HasSubstr("last dispatched kernel: " + last)));
    EXPECT_TRUE(device->lost());
    // It stays lost, whatever is asked of it.
    const auto again = assemble(*plan, {{pair()}});
    ASSERT_FALSE(again);
    EXPECT_EQ(again.error().code, ErrorCode::device_lost);
    const auto another = this->plan(*device);
    ASSERT_FALSE(another);
    EXPECT_EQ(another.error().code, ErrorCode::device_lost);
    EXPECT_TRUE(device->pipeline_cache().empty());
  }
};

TEST_F(DriverFailure, LostAtSubmission) {
  expect_lost([](vk::DeviceFunctions& vk) { vk.QueueSubmit = &lose_on_submit; });
  expect_a_new_device_works();
}

TEST_F(DriverFailure, LostWhileWaiting) {
  expect_lost([](vk::DeviceFunctions& vk) {
    real_wait = vk.WaitSemaphores;
    vk.WaitSemaphores = &lose_on_wait;
  });
  expect_a_new_device_works();
}

TEST_F(DriverFailure, TooLittleMemoryNamesTheBytesAndTheDevice) {
  const auto device = create_device();
  ASSERT_TRUE(device) << device.error().message;
  const auto real = Internal::context(*device)->functions().AllocateMemory;
  Internal::context(*device)->functions().AllocateMemory = &no_memory;
  const auto refused = plan(*device);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::internal);
  EXPECT_THAT(refused.error().message, AllOf(HasSubstr("bytes of memory"), HasSubstr(device->name())));
  // Nothing else is wrong with it.
  Internal::context(*device)->functions().AllocateMemory = real;
  auto plan = this->plan(*device);
  ASSERT_TRUE(plan) << plan.error().message;
  EXPECT_TRUE(assemble(*plan, {{pair()}}));
}

TEST_F(DriverFailure, VerifyAndDoctorReportALostDevice) {
  const auto device = create_device();
  ASSERT_TRUE(device) << device.error().message;
  auto plan = this->plan(*device);
  ASSERT_TRUE(plan) << plan.error().message;
  Internal::context(*device)->functions().QueueSubmit = &lose_on_submit;
  const auto differences = verify(*plan, pair());
  ASSERT_FALSE(differences);
  EXPECT_EQ(differences.error().code, ErrorCode::device_lost);
  const auto checks = run_doctor(*device);
  ASSERT_FALSE(checks);
  EXPECT_EQ(checks.error().code, ErrorCode::device_lost);
}

TEST_F(VulkanPlan, CapacityIsALimitOnPairsAndOnPoints) {
  auto plan = this->plan(test::device_on(Backend::vulkan));
  ASSERT_TRUE(plan);
  const ExactCloud large = exact_cloud(random_, 126);
  const CloudPair beyond{large.view(), reference_.view()};
  const auto refused = assemble(*plan, {{beyond}});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::invalid_argument);
  EXPECT_THAT(refused.error().message, AllOf(HasSubstr("201 points"), HasSubstr("200")));
  EXPECT_TRUE(assemble(*plan, {{pair()}}));
}

TEST(VulkanDevices, WrongOnesAreNamed) {
  const auto devices = enumerate_devices();
  ASSERT_TRUE(devices) << devices.error().message;
  for (const std::string wanted : {"1000", "abacus"}) {
    const auto device = create_device({.device = wanted});
    ASSERT_FALSE(device);
    EXPECT_EQ(device.error().code, ErrorCode::no_device);
    if (!devices->empty()) {
      EXPECT_THAT(device.error().message, HasSubstr(wanted));
    }
  }
  for (const DeviceInfo& info : *devices) {
    if (!info.unsuitable.empty()) continue;
    const auto device = create_device({.device = std::to_string(info.index)});
    ASSERT_TRUE(device) << device.error().message;
    EXPECT_EQ(device->name(), info.name);
    EXPECT_EQ(device->tier(), info.tier);
  }
}

}  // namespace
}  // namespace bitr
