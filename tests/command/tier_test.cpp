// bitr --tier and BITR_TIER, and the same pose from every driver and every variant of its kernels.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bitr/pose.hpp>
#include <filesystem>

#include "run_command.hpp"

namespace bitr::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using Words = std::vector<std::string>;

nlohmann::json devices(const Words& environment) {
  const Finished listed = run_command({"devices", "--json"}, environment);
  EXPECT_EQ(listed.status, 0) << listed.err;
  return nlohmann::json::parse(listed.out)["devices"];
}

Pose pose_of(const nlohmann::json& rows) {
  Pose pose;
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) pose.rotation[3 * i + j] = rows[i][j];
    pose.translation[i] = rows[i][3];
  }
  return pose;
}

struct Driver {
  const char* name;
  std::string file;  ///< empty: not installed
  Words environment;
};

// tools/quickstart.sh's pair on the CPU and on the driver, in each of its tiers.
class TierOnDriver : public testing::TestWithParam<Driver> {
 protected:
  void SetUp() override {
    if (!std::filesystem::is_regular_file(GetParam().file)) GTEST_SKIP() << "not installed";
    environment_ = GetParam().environment;
    for (const char* variable : {"VK_DRIVER_FILES=", "VK_ICD_FILENAMES="})
      environment_.push_back(variable + GetParam().file);
    const auto found = devices(environment_);
    ASSERT_EQ(found.size(), 1u);
    tier_ = found[0]["tier"];
    for (const auto& tier : found[0]["tiers"]) tiers_.push_back(tier);
    ASSERT_THAT(tiers_, testing::Contains(tier_));
    const Finished made =
        run_command({"generate", "aircraft", "--share", "0.5", "--points", "1024", "--noise", "0.005",
                     "--out", folder_.path(), "--count", "1", "--seed", "20005"});
    ASSERT_EQ(made.status, 0) << made.err;
  }
  Finished assemble(Words options, const Words& environment) const {
    options.insert(options.begin(), {"assemble", folder_.path("aircraft_000_source.ply"),
                                     folder_.path("aircraft_000_reference.ply"), "--json", "-"});
    return run_command(options, environment);
  }

  const Folder folder_;
  Words environment_, tiers_;
  std::string tier_;
};

TEST_P(TierOnDriver, EveryOneGivesTheCpusPose) {
  const Finished on_cpu = assemble({"--backend", "cpu"}, environment_);
  ASSERT_EQ(on_cpu.status, 0) << on_cpu.err;
  const auto expected = nlohmann::json::parse(on_cpu.out);
  for (const std::string& tier : tiers_) {
    SCOPED_TRACE(tier);
    const Finished finished = assemble({"--tier", tier}, environment_);
    ASSERT_EQ(finished.status, 0) << finished.err;
    const auto found = nlohmann::json::parse(finished.out);
    EXPECT_EQ(found["backend"], "vulkan");
    EXPECT_EQ(found["diagnostics"]["status"], expected["diagnostics"]["status"]);
    const Pose pose = pose_of(found["transform"]), cpu = pose_of(expected["transform"]);
    EXPECT_LE(rotation_error_degrees(pose, cpu), 0.05);
    EXPECT_LE(translation_error(pose, cpu), 1e-3);
    RecordProperty(tier, std::to_string(rotation_error_degrees(pose, cpu)));
  }
}

TEST_P(TierOnDriver, IsRefusedWhereItCannotRun) {
  std::size_t refused = 0;
  for (const std::string tier : {"basic", "shuffle", "texels"}) {
    if (std::ranges::find(tiers_, tier) != tiers_.end()) continue;
    SCOPED_TRACE(tier);
    ++refused;
    const Finished finished = assemble({"--tier", tier}, environment_);
    EXPECT_EQ(finished.status, 2);
    EXPECT_EQ(finished.out, "");
    EXPECT_THAT(finished.err, AllOf(HasSubstr("bitr: --tier " + tier), HasSubstr("subgroups of 8 to 32"),
                                    HasSubstr("it executes basic")));
    Words environment = environment_;
    environment.push_back("BITR_TIER=" + tier);
    const Finished asked = assemble({"--backend", "vulkan"}, environment);
    EXPECT_EQ(asked.status, 2);
    EXPECT_THAT(asked.err, HasSubstr("tier " + tier + " cannot run on"));
  }
  EXPECT_EQ(refused + tiers_.size(), 3u);
}

INSTANTIATE_TEST_SUITE_P(Drivers, TierOnDriver,
                         testing::Values(Driver{"lavapipe", BITR_LAVAPIPE, {"LP_NATIVE_VECTOR_WIDTH=256"}},
                                         Driver{
                                             "lavapipe_128", BITR_LAVAPIPE, {"LP_NATIVE_VECTOR_WIDTH=128"}},
                                         Driver{"swiftshader", BITR_SWIFTSHADER, {}}),
                         [](const auto& driver) { return std::string(driver.param.name); });

TEST(Tier, IsNotForTheCpu) {
  const Folder folder;
  const PairFiles pair = generate_files(folder, "copy", "60");
  const Finished finished =
      run_command({"assemble", pair.source, pair.reference, "--backend", "cpu", "--tier", "basic"});
  EXPECT_EQ(finished.status, 2);
  EXPECT_THAT(finished.err, HasSubstr("--tier basic: chooses among Vulkan kernels, --backend is cpu"));
}

TEST(Tier, UnknownOnesAreNamed) {
  const Folder folder;
  const PairFiles pair = generate_files(folder, "copy", "60");
  const Finished option = run_command({"assemble", pair.source, pair.reference, "--tier", "fast"});
  EXPECT_EQ(option.status, 2);
  EXPECT_THAT(option.err, AllOf(HasSubstr("\"fast\""), HasSubstr("basic|shuffle|texels")));
  if (devices({}).empty()) GTEST_SKIP() << "no Vulkan device";
  const Finished variable =
      run_command({"assemble", pair.source, pair.reference, "--backend", "vulkan"}, {"BITR_TIER=fast"});
  EXPECT_EQ(variable.status, 2);
  EXPECT_THAT(variable.err, HasSubstr("BITR_TIER=fast is not one of basic, shuffle, texels"));
}

}  // namespace
}  // namespace bitr::test
