#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bitr/device.hpp>
#include <bitr/io.hpp>
#include <bitr/pose.hpp>

#include "run_command.hpp"

namespace bitr::test {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

Pose pose_in(const nlohmann::json& matrix) {
  Pose pose;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) pose.rotation[3 * row + column] = matrix[row][column];
    pose.translation[row] = matrix[row][3];
  }
  return pose;
}

nlohmann::json matrix_of(const Pose& pose) {
  const auto m = pose.matrix();
  nlohmann::json rows;
  for (int row = 0; row < 4; ++row)
    rows.push_back({m[4 * row], m[4 * row + 1], m[4 * row + 2], m[4 * row + 3]});
  return rows;
}

/// Two overlapping parts of one aircraft, and a start that is 5° off the truth.
struct Pair : PairFiles {
  explicit Pair(const Folder& folder) : PairFiles(generate_files(folder, "aircraft", "700", "3")) {
    truth_pose = pose_in(read_json(truth)["T_reference_source"]);
    Pose turn;
    turn.rotation = {0.9961947, -0.0871557, 0, 0.0871557, 0.9961947, 0, 0, 0, 1};
    const Pose off = truth_pose * turn;
    start = folder.write("start.json", nlohmann::json{{"transform", matrix_of(off)}}.dump());
  }
  Pose truth_pose;
  std::string start;
};

TEST(RefineCommand, RefinesAndSaysSo) {
  const Folder folder;
  const Pair pair(folder);
  const std::string json = folder.path("result.json"), cloud = folder.path("joined.ply");
  const Finished finished =
      run_command({"refine", pair.source, pair.reference, "--pose", pair.start, "--protocol", "default",
                   "--json", json, "-o", cloud, "--truth", pair.truth});
  ASSERT_EQ(finished.status, 0) << finished.err;
  EXPECT_EQ(finished.err, "");
  for (const char* line : {"T_reference_source", "icp, default protocol", "kept        the refined pose",
                           "score", "RMSE", "error"})
    EXPECT_THAT(finished.out, HasSubstr(line));

  const auto result = read_json(json);
  const auto& refinement = result["refinement"];
  EXPECT_EQ(refinement["method"], "icp");
  EXPECT_EQ(refinement["protocol"], "default");
  EXPECT_EQ(refinement["kept"], "after");
  EXPECT_EQ(refinement["after"], result["transform"]);
  EXPECT_GT(refinement["score_after"], refinement["score_before"]);
  EXPECT_GE(refinement["iterations"], 2);
  EXPECT_TRUE(refinement["converged"].is_boolean());
  const Pose before = pose_in(refinement["before"]), after = pose_in(result["transform"]);
  EXPECT_NEAR(rotation_error_degrees(before, pair.truth_pose), 5, 0.01);
  EXPECT_LE(rotation_error_degrees(after, pair.truth_pose), 2);
  EXPECT_NEAR(result["errors"]["rotation_degrees"], rotation_error_degrees(after, pair.truth_pose), 1e-9);

  const auto joined = io::read_cloud(cloud);
  ASSERT_TRUE(joined);
  EXPECT_EQ(joined->size(),
            std::size_t{result["points"]["source"]} + std::size_t{result["points"]["reference"]});
}

TEST(RefineCommand, TheOfficialProtocolIsTheDefault) {
  const Folder folder;
  const Pair pair(folder);
  for (const char* method : {"icp", "ot"}) {
    const std::string json = folder.path(std::string(method) + ".json");
    const Finished finished = run_command({"refine", pair.source, pair.reference, "--init", pair.start,
                                           "--method", method, "--iterations", "3", "--json", json});
    ASSERT_EQ(finished.status, 0) << finished.err;
    const auto refinement = read_json(json)["refinement"];
    EXPECT_EQ(refinement["method"], method);
    EXPECT_EQ(refinement["protocol"], "official");
    EXPECT_EQ(refinement["iterations"], 3);
    EXPECT_EQ(refinement["converged"], false);
    const bool after = refinement["kept"] == "after";
    EXPECT_EQ(after, refinement["score_after"] > refinement["score_before"]);
    EXPECT_EQ(read_json(json)["transform"], refinement[after ? "after" : "before"]);
  }
}

TEST(RefineCommand, OnVulkanItIsTheCpus) {
  const auto devices = enumerate_devices();
  if (!devices || devices->empty()) GTEST_SKIP() << "no Vulkan device";
  const Folder folder;
  const Pair pair(folder);
  for (const char* method : {"icp", "ot"}) {
    const auto refined = [&](const std::string& backend) {
      const std::string json = folder.path(backend + ".json");
      const Finished finished =
          run_command({"refine", pair.source, pair.reference, "--pose", pair.start, "--method", method,
                       "--protocol", "default", "--backend", backend, "--json", json});
      EXPECT_EQ(finished.status, 0) << finished.err;
      const auto result = read_json(json);
      EXPECT_EQ(result["backend"], backend);
      return result["refinement"];
    };
    const auto vulkan = refined("vulkan"), cpu = refined("cpu");
    EXPECT_LE(rotation_error_degrees(pose_in(vulkan["after"]), pose_in(cpu["after"])), 1e-3) << method;
    EXPECT_EQ(vulkan["kept"], cpu["kept"]) << method;
  }
}

TEST(RefineCommand, SameBytesEveryTimeForAnyThreads) {
  const Folder folder;
  const Pair pair(folder);
  std::vector<nlohmann::json> results;
  for (const char* threads : {"1", "2", "3"}) {
    const Finished finished = run_command({"refine", pair.source, pair.reference, "--pose", pair.start,
                                           "--protocol", "default", "--threads", threads, "--json", "-"});
    ASSERT_EQ(finished.status, 0) << finished.err;
    auto json = nlohmann::json::parse(finished.out);
    json.erase("timing_ms");
    results.push_back(json);
  }
  EXPECT_EQ(results[0], results[1]);
  EXPECT_EQ(results[0], results[2]);
}

TEST(RefineCommand, KeepsAStartThatItCannotImprove) {
  const Folder folder;
  const Pair pair(folder);
  const Finished finished = run_command(
      {"refine", pair.source, pair.reference, "--pose", "identity", "--protocol", "default", "--json", "-"});
  ASSERT_EQ(finished.status, 0) << finished.err;
  const auto result = nlohmann::json::parse(finished.out);
  EXPECT_EQ(result["refinement"]["kept"], "before");
  EXPECT_THAT(std::string(result["refinement"]["reason"]), HasSubstr("too little"));
  EXPECT_EQ(result["transform"], matrix_of({}));
}

TEST(RefineCommand, AssembleRefines) {
  const Folder folder;
  const Pair pair(folder);
  const std::string plain = folder.path("plain.json"), refined = folder.path("refined.json");
  ASSERT_EQ(run_command({"assemble", pair.source, pair.reference, "--json", plain, "--refine=none"}).status,
            0);
  const Finished finished =
      run_command({"assemble", pair.source, pair.reference, "--json", refined, "--refine"});
  ASSERT_EQ(finished.status, 0) << finished.err;
  EXPECT_THAT(finished.out, HasSubstr("refinement  icp, default protocol"));
  const auto before = read_json(plain), after = read_json(refined);
  EXPECT_TRUE(before["refinement"].is_null());
  EXPECT_EQ(after["refinement"]["before"], before["transform"]);
  EXPECT_EQ(after["refinement"]["kept"] == "after" ? after["refinement"]["after"] : before["transform"],
            after["transform"]);
}

TEST(RefineCommand, BadInputIsStatusTwoAndWritesNothing) {
  const Folder folder;
  const Pair pair(folder);
  const std::string cloud = folder.path("joined.ply"), json = folder.path("result.json");
  const std::string mirror =
      folder.write("mirror.json", R"({"transform": [[-1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]})");
  const std::string two = folder.write("two.xyz", "0 0 0\n1 1 1\n");
  const auto refuses = [&](std::vector<std::string> words, const std::string& why) {
    words.insert(words.begin(), "refine");
    words.insert(words.end(), {"-o", cloud, "--json", json});
    const Finished finished = run_command(words);
    EXPECT_EQ(finished.status, 2) << why;
    EXPECT_EQ(finished.out, "");
    EXPECT_THAT(finished.err, StartsWith("bitr: "));
    EXPECT_THAT(finished.err, HasSubstr(why));
    EXPECT_EQ(std::count(finished.err.begin(), finished.err.end(), '\n'), 1) << finished.err;
    EXPECT_FALSE(std::filesystem::exists(cloud));
    EXPECT_FALSE(std::filesystem::exists(json));
  };
  refuses({pair.source, folder.path("none.ply")}, "none.ply");
  refuses({pair.source, pair.reference, "--pose", folder.path("none.json")}, "none.json");
  refuses({pair.source, pair.reference, "--pose", mirror}, "mirror.json");
  refuses({two, pair.reference}, "two.xyz");
  refuses({two, pair.reference}, "2 points; at least 3 are needed");
  refuses({pair.source, pair.reference, "--keep", "1.5"}, "--keep 1.5: is not above 0 and up to 1");
  refuses({pair.source, pair.reference, "--keep", "0.5", "--method", "ot"}, "--keep 0.5");
  refuses({pair.source, pair.reference, "--least-overlap", "0.3"}, "--least-overlap 0.3");
  refuses({pair.source, pair.reference, "--iterations", "0"}, "\"0\" is not a whole number in 1 … 100000");
  refuses({pair.source, pair.reference, "--method", "nearest"}, "\"nearest\" is not one of icp|ot");
  refuses({pair.source, pair.reference, "--protocol", "mine"}, "\"mine\" is not one of default|official");
}

}  // namespace
}  // namespace bitr::test
