// --backend, --device, --profile and the cache of compiled kernels; bitr devices and bitr doctor.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <bitr/pose.hpp>

#include "run_command.hpp"

namespace bitr::test {
namespace {

using testing::HasSubstr;
using Words = std::vector<std::string>;

// A loader that finds no driver.
const Words no_driver = {"VK_DRIVER_FILES=/dev/null", "VK_ICD_FILENAMES=/dev/null"};

nlohmann::json devices(const Words& environment = {}) {
  const Finished finished = run_command({"devices", "--json"}, environment);
  EXPECT_EQ(finished.status, 0) << finished.err;
  return nlohmann::json::parse(finished.out, nullptr, false);
}

bool has_vulkan() {
  const auto json = devices();
  return std::ranges::any_of(json["devices"], [](const auto& device) { return device["usable"]; });
}

void expect_refused(const Finished& finished, const std::string& says) {
  EXPECT_EQ(finished.status, 2);
  EXPECT_THAT(finished.err, testing::MatchesRegex("bitr: [^\n]*\n"));
  EXPECT_THAT(finished.err, HasSubstr(says));
  EXPECT_EQ(finished.out, "");
}

class Device : public testing::Test {
 protected:
  Finished assemble(Words options, const Words& environment = {}) const {
    options.insert(options.begin(), {"assemble", pair.source, pair.reference, "--complete-match"});
    return run_command(options, environment);
  }
  Folder folder;
  PairFiles pair = generate_files(folder, "copy", "200");
};

// Where there is a Vulkan device, whichever.
class VulkanDevice : public Device {
 protected:
  void SetUp() override {
    if (!has_vulkan()) GTEST_SKIP() << "no Vulkan device";
  }
};

TEST(Devices, ListsWhatEachDeviceGets) {
  const auto json = devices();
  for (const auto& device : json["devices"])
    for (const char* key : {"index", "name", "driver", "type", "api_version", "tier", "tiers",
                            "subgroup_size", "memory_bytes", "quirks", "usable", "unsuitable"})
      EXPECT_TRUE(device.contains(key)) << key;
  const Finished text = run_command({"devices"});
  EXPECT_EQ(text.status, 0);
  EXPECT_EQ(text.err, "");
  for (const auto& device : json["devices"])
    EXPECT_THAT(text.out, HasSubstr(device["name"].get<std::string>()));
  EXPECT_THAT(text.out, HasSubstr(json["auto"]["device"].get<std::string>()));
}

TEST(Devices, AutoTakesAGpuAndNeverADriverOnTheCpu) {
  const auto json = devices();
  bool gpu = false;
  for (const auto& device : json["devices"])
    gpu |= device["usable"] && device["type"] != "cpu" && device["type"] != "other";
  EXPECT_EQ(json["auto"]["backend"], gpu ? "vulkan" : "cpu");
}

TEST(Devices, NoDriverIsAnEmptyList) {
  const auto json = devices(no_driver);
  EXPECT_TRUE(json["devices"].empty());
  EXPECT_EQ(json["auto"]["backend"], "cpu");
  EXPECT_THAT(run_command({"devices"}, no_driver).out, HasSubstr("no Vulkan device"));
}

TEST_F(Device, WithoutADriverAutoRunsOnTheCpuAndVulkanIsRefused) {
  const Finished finished = assemble({"--json", "-"}, no_driver);
  ASSERT_EQ(finished.status, 0) << finished.err;
  EXPECT_EQ(nlohmann::json::parse(finished.out)["backend"], "cpu");
  expect_refused(assemble({"--backend", "vulkan"}, no_driver), "--backend vulkan: no Vulkan");
  expect_refused(assemble({"--device", "0"}, no_driver), "--device 0: no Vulkan");
  expect_refused(run_command({"doctor", "--backend", "vulkan"}, no_driver), "no Vulkan");
}

TEST_F(Device, DoublePrecisionOnAutoIsTheCpu) {
  for (const Words& options : {Words{"--precision", "f64"}, Words{"--as-defined"}}) {
    Words words = options;
    words.insert(words.end(), {"--json", "-"});
    const Finished finished = assemble(words);
    ASSERT_EQ(finished.status, 0) << finished.err;
    EXPECT_EQ(nlohmann::json::parse(finished.out)["backend"], "cpu");
  }
}

TEST_F(Device, DoctorPassesOnTheCpu) {
  const std::string json = folder.path("doctor.json");
  const Finished finished = run_command({"doctor", "--backend", "cpu", "--json", json});
  EXPECT_EQ(finished.status, 0) << finished.out;
  EXPECT_THAT(finished.out, HasSubstr("PASS  operation"));
  EXPECT_EQ(finished.out.find("FAIL"), std::string::npos);
  const auto report = read_json(json);
  EXPECT_EQ(report["passed"], true);
  EXPECT_GT(report["checks"].size(), 20u);
  for (const auto& check : report["checks"]) EXPECT_LE(check["measured"], check["allowed"]);
}

TEST_F(Device, ProfileIsATraceOfEveryOperation) {
  const std::string trace = folder.path("profile.trace.json"), json = folder.path("result.json");
  ASSERT_EQ(assemble({"--backend", "cpu", "--profile", trace, "--json", json}).status, 0);
  int passes = 0, operations = 0;
  const auto written = read_json(trace);
  for (const auto& event : written["traceEvents"]) {
    if (event["ph"] != "X") continue;
    EXPECT_GE(event["ts"], 0);
    EXPECT_GE(event["dur"], 0);
    (event["name"] == "forward pass" ? passes : operations) += 1;
  }
  // The pair, complete matching's second pass and the swap check.
  EXPECT_EQ(passes, 3);
  EXPECT_EQ(operations % 3, 0);
  EXPECT_GE(operations, 3 * 10);
}

TEST_F(VulkanDevice, WrongDevicesAreOneClearLine) {
  expect_refused(assemble({"--device", "1000"}), "--device 1000");
  expect_refused(assemble({"--device", "abacus"}), "abacus");
  expect_refused(assemble({"--backend", "vulkan", "--device", "abacus"}), "abacus");
  expect_refused(assemble({"--backend", "vulkan", "--precision", "f64"}), "f64");
  expect_refused(assemble({"--backend", "vulkan", "--as-defined"}), "as defined");
  expect_refused(run_command({"doctor", "--device", "1000"}), "1000");
}

TEST_F(VulkanDevice, PoseIsTheCpus) {
  const auto pose = [&](const char* backend) {
    const Finished finished = assemble({"--backend", backend, "--json", "-"});
    EXPECT_EQ(finished.status, 0) << finished.err;
    const auto json = nlohmann::json::parse(finished.out);
    EXPECT_EQ(json["backend"], backend);
    EXPECT_TRUE(json["timing_ms"].contains("knn"));
    Pose result;
    for (int row = 0; row < 3; ++row)
      for (int column = 0; column < 3; ++column)
        result.rotation[3 * row + column] = json["rotation"][row][column];
    return result;
  };
  EXPECT_LE(rotation_error_degrees(pose("vulkan"), pose("cpu")), 0.05);
}

TEST_F(Device, NeighboursAreTheSameHoweverTheyAreSearched) {
  for (const std::string backend : {"cpu", "vulkan"}) {
    if (backend == "vulkan" && !has_vulkan()) continue;
    const auto pose = [&](const Words& options) {
      Words words = {"--backend", backend, "--json", "-"};
      words.insert(words.end(), options.begin(), options.end());
      const Finished finished = assemble(words);
      EXPECT_EQ(finished.status, 0) << finished.err;
      return nlohmann::json::parse(finished.out)["transform"];
    };
    const auto expected = pose({});
    EXPECT_EQ(pose({"--neighbors", "brute-force"}), expected) << backend;
    EXPECT_EQ(pose({"--neighbors", "tree"}), expected) << backend;
  }
  expect_refused(assemble({"--neighbors", "octree"}), "\"octree\" is not one of auto|brute-force|tree");
}

TEST_F(VulkanDevice, VerifyComparesEveryStage) {
  const Finished finished = assemble({"--backend", "vulkan", "--verify"});
  EXPECT_EQ(finished.status, 0) << finished.out << finished.err;
  EXPECT_THAT(finished.out, HasSubstr("out.R"));
  EXPECT_EQ(finished.out.find("BEYOND"), std::string::npos) << finished.out;
}

TEST_F(VulkanDevice, BenchCountsWhatThePlanAsksOfTheDevice) {
  const std::string trace = folder.path("bench.trace.json");
  const Finished finished = run_command({"bench", "--model-forward", "--points", "64", "--repeats", "2",
                                         "--backend", "vulkan", "--json", "-", "--profile", trace});
  ASSERT_EQ(finished.status, 0) << finished.err;
  const auto json = nlohmann::json::parse(finished.out);
  EXPECT_EQ(json["backend"], "vulkan");
  EXPECT_GE(json["dispatches"], json["operations"]);
  EXPECT_GT(json["barriers"], 0);
  EXPECT_GE(json["submissions"], 1);
  EXPECT_GT(json["arena_bytes"], 0);
  EXPECT_GT(read_json(trace)["traceEvents"].size(), 10u);
}

TEST_F(VulkanDevice, NeighboursAreSearchedAsAsked) {
  const auto bench = [](const Words& options) {
    Words words = {"bench", "--model-forward", "--points", "64", "--repeats", "1", "--backend", "vulkan"};
    words.insert(words.end(), {"--json", "-"});
    words.insert(words.end(), options.begin(), options.end());
    const Finished finished = run_command(words);
    EXPECT_EQ(finished.status, 0) << finished.err;
    return nlohmann::json::parse(finished.out)["dispatches"].get<int>();
  };
  const int brute_force = bench({"--neighbors", "brute-force"});
  EXPECT_EQ(bench({}), brute_force);
  EXPECT_EQ(bench({"--neighbors", "auto"}), brute_force);
  EXPECT_GT(bench({"--neighbors", "tree"}), brute_force);
}

TEST_F(VulkanDevice, DoctorPasses) {
  const Finished finished = run_command({"doctor", "--backend", "vulkan"});
  EXPECT_EQ(finished.status, 0) << finished.out << finished.err;
  EXPECT_EQ(finished.out.find("FAIL"), std::string::npos) << finished.out;
}

TEST_F(VulkanDevice, KeepsCompiledKernels) {
  const std::string cache = folder.path("cache");
  const Words environment = {"XDG_CACHE_HOME=" + cache};
  const auto result = [&](const Words& extra = {}) {
    Words words = {"--backend", "vulkan", "--json", "-"};
    words.insert(words.end(), extra.begin(), extra.end());
    const Finished finished = assemble(words, environment);
    EXPECT_EQ(finished.status, 0) << finished.err;
    EXPECT_THAT(finished.err, testing::Not(HasSubstr("bitr: ")));
    auto json = nlohmann::json::parse(finished.out);
    json.erase("timing_ms");
    return json.dump();
  };
  const std::string uncached = result({"--no-cache"});
  EXPECT_FALSE(std::filesystem::exists(cache + "/bitr"));
  EXPECT_EQ(result(), uncached);
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(cache + "/bitr"))
    files.push_back(entry.path());
  ASSERT_EQ(files.size(), 1u);
  EXPECT_EQ(files[0].extension(), ".pipelines");
  EXPECT_EQ(result(), uncached);
  // Damaged, or of another device: of no use, and no error.
  for (const std::string& junk : {std::string(), std::string(5, 'x'), std::string(100000, 'x')}) {
    folder.write(std::filesystem::relative(files[0], folder.path()).string(), junk);
    EXPECT_EQ(result(), uncached);
    EXPECT_NE(read_text(files[0]), junk);
  }
  // A file where the folder should be.
  std::filesystem::remove_all(cache);
  folder.write("cache", "no folder");
  EXPECT_EQ(result(), uncached);
}

}  // namespace
}  // namespace bitr::test
