// Which tier a device gets, what its pipelines ask for, and what is refused, on drivers with other subgroups:
// the layer in other_subgroups/ makes them up.
#include <gmock/gmock.h>

#include <unistd.h>

#include <algorithm>
#include <bitr/vulkan.hpp>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>

#include "api/internal.hpp"
#include "vk/network.hpp"

namespace bitr {
namespace {

using test::VulkanNetwork;
using testing::AllOf;
using testing::HasSubstr;
using Variables = std::map<std::string, std::string>;

/// The environment, while it lasts. The Vulkan loader and the layer read it as they go.
class Environment {
 public:
  explicit Environment(const Variables& variables) : variables_(variables) {
    for (const auto& [name, value] : variables_) setenv(name.c_str(), value.c_str(), 1);
  }
  ~Environment() {
    for (const auto& [name, value] : variables_) unsetenv(name.c_str());
  }
  Environment(const Environment&) = delete;
  Environment& operator=(const Environment&) = delete;

 private:
  Variables variables_;
};

struct Driver {
  const char* name;
  Variables variables;
  bool shares;             ///< Tier::shuffle can be executed
  std::uint32_t required;  ///< subgroup size that pipelines ask for
};

Variables sizes(int reported, int least, int most, bool may_require) {
  return {{"SUBGROUPS_REPORTED", std::to_string(reported)},
          {"SUBGROUPS_LEAST", std::to_string(least)},
          {"SUBGROUPS_MOST", std::to_string(most)},
          {"SUBGROUPS_STAGES", may_require ? std::to_string(VK_SHADER_STAGE_COMPUTE_BIT) : "0"}};
}
Variables hidden(int reported) {
  return {{"SUBGROUPS_REPORTED", std::to_string(reported)}, {"SUBGROUPS_HIDDEN", "1"}};
}

const Driver drivers[] = {
    {"four", sizes(4, 4, 4, true), false, 0},
    {"eight", sizes(8, 8, 8, true), true, 8},
    {"sixteen", sizes(16, 16, 16, true), true, 16},
    {"thirty_two", sizes(32, 32, 32, true), true, 32},
    {"sixty_four", sizes(64, 64, 64, true), false, 0},
    // A size for every kernel, as the driver likes.
    {"eight_to_thirty_two", sizes(32, 8, 32, true), true, 8},
    {"eight_to_thirty_two_unasked", sizes(32, 8, 32, false), true, 0},
    {"thirty_two_or_sixty_four", sizes(64, 32, 64, true), true, 32},
    {"thirty_two_or_sixty_four_unasked", sizes(64, 32, 64, false), false, 0},
    {"thirty_two_or_sixty_four_reporting_less", sizes(32, 32, 64, false), false, 0},
    {"four_to_sixteen", sizes(16, 4, 16, true), true, 8},
    {"four_to_sixteen_unasked", sizes(16, 4, 16, false), false, 0},
    // One that says no more than a number may have kernels with another.
    {"unknown", hidden(32), false, 0},
};

class Tiers : public testing::TestWithParam<Driver> {
 protected:
  static void SetUpTestSuite() {
    if (test::vulkan()) expected();
  }
  void SetUp() override {
    if (!test::vulkan()) GTEST_SKIP() << "no Vulkan device";
    if (test::vulkan()->capabilities().subgroup_size < 8) GTEST_SKIP() << "too small subgroups of its own";
    Variables variables = GetParam().variables;
    variables.insert({{"VK_LAYER_PATH", BITR_LAYERS},
                      {"VK_INSTANCE_LAYERS", "VK_LAYER_BITR_other_subgroups"},
                      {"SUBGROUPS_LOG", log_}});
    std::filesystem::remove(log_);
    environment_.emplace(variables);
  }

  static const VulkanNetwork& network() {
    static const VulkanNetwork network({{40, 133}, {70, 65}});
    return network;
  }
  // Made without the layer.
  static const std::vector<float>& expected() {
    static const std::vector<float> poses = [] {
      vk::Executor executor(test::vulkan(), network().graph, network().capacity());
      return network().run(executor);
    }();
    return poses;
  }
  static void expect_poses(const std::shared_ptr<vk::Context>& context) {
    vk::Executor executor(context, network().graph, network().capacity());
    const std::vector<float> found = network().run(executor);
    ASSERT_EQ(found.size(), expected().size());
    for (std::size_t i = 0; i < found.size(); ++i) EXPECT_NEAR(found[i], expected()[i], 1e-3) << i;
  }
  std::vector<std::string> logged() const {
    std::vector<std::string> lines;
    std::ifstream file(log_);
    for (std::string line; std::getline(file, line);) lines.push_back(line);
    return lines;
  }

 private:
  const std::string log_ = testing::TempDir() + "bitr_tier_test_" + std::to_string(getpid());
  std::optional<Environment> environment_;
};

TEST_P(Tiers, AreWhatEveryPossibleSubgroupAllows) {
  const vk::Context context(vk::OwnDevice{});
  const vk::Capabilities& c = context.capabilities();
  EXPECT_TRUE(c.executes(Tier::basic));
  EXPECT_EQ(c.executes(Tier::shuffle), GetParam().shares);
  EXPECT_EQ(c.required_subgroup, GetParam().required);
  EXPECT_EQ(c.shuffle, GetParam().shares);
  EXPECT_EQ(c.tier() == Tier::basic, !GetParam().shares);
}

TEST_P(Tiers, AreRefusedWhereTheyCannotBeExecuted) {
  if (GetParam().shares) {
    const vk::Context context(vk::OwnDevice{.tier = Tier::shuffle});
    EXPECT_EQ(context.capabilities().tier(), Tier::shuffle);
    EXPECT_FALSE(context.capabilities().texels);
    return;
  }
  for (const Tier tier : {Tier::shuffle, Tier::texels}) {
    const auto refused = create_device({.tier = tier});
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, ErrorCode::unsupported);
    EXPECT_THAT(refused.error().message,
                AllOf(HasSubstr("tier " + std::string(name(tier))), HasSubstr("subgroups of 8 to 32"),
                      HasSubstr("it executes basic")));
  }
}

TEST_P(Tiers, GivePipelinesTheSubgroupsThatTheirShadersNeed) {
  const Tier tier = GetParam().shares ? Tier::shuffle : Tier::basic;
  expect_poses(std::make_shared<vk::Context>(vk::OwnDevice{.tier = tier}));
  const std::vector<std::string> lines = logged();
  ASSERT_GT(lines.size(), 10u);
  const bool control = !GetParam().variables.contains("SUBGROUPS_HIDDEN");
  EXPECT_EQ(lines[0], control ? "device 1 1" : "device 0 0");
  // Three searches, and messages in two sizes: those of the hidden layers are one.
  const std::string asking = std::to_string(GetParam().required) + " 1";
  const auto count = [&](const std::string& line) { return std::count(lines.begin(), lines.end(), line); };
  EXPECT_EQ(count(asking), GetParam().shares ? 5 : 0);
  EXPECT_EQ(count("0 0") + count(asking), static_cast<std::ptrdiff_t>(lines.size()) - 1);
}

INSTANTIATE_TEST_SUITE_P(Drivers, Tiers, testing::ValuesIn(drivers),
                         [](const auto& driver) { return std::string(driver.param.name); });

// An application's instance and device, on which nothing but timeline semaphores is enabled.
class Host {
 public:
  Host() : get_(vk::system_loader()) {
    const VkApplicationInfo application{.sType = VK_STRUCTURE_TYPE_APPLICATION_INFO,
                                        .pNext = nullptr,
                                        .pApplicationName = "host",
                                        .applicationVersion = 0,
                                        .pEngineName = nullptr,
                                        .engineVersion = 0,
                                        .apiVersion = VK_API_VERSION_1_2};
    const VkInstanceCreateInfo info{.sType = VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO,
                                    .pNext = nullptr,
                                    .flags = 0,
                                    .pApplicationInfo = &application,
                                    .enabledLayerCount = 0,
                                    .ppEnabledLayerNames = nullptr,
                                    .enabledExtensionCount = 0,
                                    .ppEnabledExtensionNames = nullptr};
    const auto create = reinterpret_cast<PFN_vkCreateInstance>(get_(nullptr, "vkCreateInstance"));
    vk::check(create(&info, nullptr, &instance_), "vkCreateInstance");
    functions_.emplace(get_, instance_);
    std::uint32_t one = 1;
    functions_->EnumeratePhysicalDevices(instance_, &one, &physical_);
    const float priority = 1;
    const VkDeviceQueueCreateInfo queue{.sType = VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO,
                                        .pNext = nullptr,
                                        .flags = 0,
                                        .queueFamilyIndex = 0,
                                        .queueCount = 1,
                                        .pQueuePriorities = &priority};
    VkPhysicalDeviceTimelineSemaphoreFeatures timeline{
        .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_TIMELINE_SEMAPHORE_FEATURES,
        .pNext = nullptr,
        .timelineSemaphore = VK_TRUE};
    const VkDeviceCreateInfo wanted{.sType = VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO,
                                    .pNext = &timeline,
                                    .flags = 0,
                                    .queueCreateInfoCount = 1,
                                    .pQueueCreateInfos = &queue,
                                    .enabledLayerCount = 0,
                                    .ppEnabledLayerNames = nullptr,
                                    .enabledExtensionCount = 0,
                                    .ppEnabledExtensionNames = nullptr,
                                    .pEnabledFeatures = nullptr};
    vk::check(functions_->CreateDevice(physical_, &wanted, nullptr, &device_), "vkCreateDevice");
    vk_ = vk::DeviceFunctions(functions_->GetDeviceProcAddr, device_);
    vk_.GetDeviceQueue(device_, 0, 0, &queue_);
  }
  ~Host() {
    vk_.DestroyDevice(device_, nullptr);
    functions_->DestroyInstance(instance_, nullptr);
  }
  Host(const Host&) = delete;
  Host& operator=(const Host&) = delete;

  Result<Device> adopt(std::optional<Tier> tier) const {
    return vk::adopt({.get_instance_proc_addr = get_,
                      .instance = instance_,
                      .physical_device = physical_,
                      .device = device_,
                      .queue = queue_,
                      .timeline_semaphore_enabled = true,
                      .tier = tier});
  }

 private:
  PFN_vkGetInstanceProcAddr get_;
  VkInstance instance_ = VK_NULL_HANDLE;
  std::optional<vk::InstanceFunctions> functions_;
  VkPhysicalDevice physical_ = VK_NULL_HANDLE;
  VkDevice device_ = VK_NULL_HANDLE;
  vk::DeviceFunctions vk_;
  VkQueue queue_ = VK_NULL_HANDLE;
};

// What an application has not enabled is not used, and what then cannot be known is not assumed.
TEST_P(Tiers, OfAnAdoptedDeviceDoWithoutTheFeature) {
  const Host host;
  for (const Tier tier : {Tier::basic, Tier::shuffle}) {
    const auto device = host.adopt(tier);
    const auto least = GetParam().variables.find("SUBGROUPS_LEAST"),
               most = GetParam().variables.find("SUBGROUPS_MOST");
    const bool known = least != GetParam().variables.end();
    const bool can =
        tier == Tier::basic || (known && std::stoi(least->second) >= 8 && std::stoi(most->second) <= 32);
    ASSERT_EQ(device.has_value(), can) << (device ? "" : device.error().message);
    if (!can) {
      EXPECT_EQ(device.error().code, ErrorCode::unsupported);
      continue;
    }
    EXPECT_EQ(device->tier(), name(tier));
    EXPECT_EQ(Internal::context(*device)->capabilities().required_subgroup, 0u);
    EXPECT_FALSE(Internal::context(*device)->capabilities().full_subgroups);
  }
}

// The driver at hand, as it is.
TEST(Tier, IsTheAskedOne) {
  BITR_NEEDS_VULKAN();
  for (const Tier tier : {Tier::basic, Tier::shuffle, Tier::texels}) {
    EXPECT_EQ(tier_named(name(tier)), tier);
    if (!test::vulkan()->capabilities().executes(tier)) continue;
    const auto device = create_device({.tier = tier});
    ASSERT_TRUE(device) << device.error().message;
    EXPECT_EQ(device->tier(), name(tier));
    EXPECT_EQ(Internal::context(*device)->capabilities().shuffle, tier != Tier::basic);
    EXPECT_EQ(Internal::context(*device)->capabilities().texels, tier == Tier::texels);
  }
  EXPECT_EQ(tier_named("Basic"), std::nullopt);
  EXPECT_EQ(tier_named(""), std::nullopt);
}

}  // namespace
}  // namespace bitr
