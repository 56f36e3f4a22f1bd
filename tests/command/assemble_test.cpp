#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bitr/io.hpp>
#include <bitr/model.hpp>
#include <bitr/pose.hpp>
#include <cmath>
#include <fstream>

#include "run_command.hpp"

namespace bitr::test {
namespace {

using testing::HasSubstr;
using testing::Not;

Pose pose_of(const nlohmann::json& matrix) {
  Pose pose;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) pose.rotation[3 * row + column] = matrix[row][column];
    pose.translation[row] = matrix[row][3];
  }
  return pose;
}

class Assemble : public testing::Test {
 protected:
  Finished run(const PairFiles& pair, std::vector<std::string> options) const {
    options.insert(options.begin(), {"assemble", pair.source, pair.reference});
    return run_command(options);
  }
  Folder folder;
  PairFiles copy = generate_files(folder, "copy");
};

TEST_F(Assemble, CompleteMatchRecoversTheTruth) {
  for (const std::string seed : {"1", "2", "3"}) {
    const PairFiles pair = generate_files(folder, "copy", "600", seed);
    const std::string json = folder.path("result.json");
    const Finished finished = run(pair, {"--complete-match", "--json", json, "--strict"});
    ASSERT_EQ(finished.status, 0) << finished.err;
    const Pose found = pose_of(read_json(json)["transform"]);
    const Pose truth = pose_of(read_json(pair.truth)["T_reference_source"]);
    EXPECT_LE(rotation_error_degrees(found, truth), 0.1);
    EXPECT_LE(translation_error(found, truth), 1e-3);
  }
}

TEST_F(Assemble, TextHasThePoseAndTheErrors) {
  const Finished finished = run(copy, {"--complete-match", "--truth", copy.truth});
  EXPECT_EQ(finished.status, 0);
  EXPECT_EQ(finished.err, "");
  for (const char* word :
       {"T_reference_source", "status      ok", "overlap     100.0 %", "error       rotation"})
    EXPECT_THAT(finished.out, HasSubstr(word));
}

// The same points, nothing else.
std::string without_normals(const std::string& path) {
  const std::string plain = path + ".xyz";
  std::ofstream file(plain);
  file.precision(17);
  const auto cloud = io::read_cloud(path);
  for (const Vec3d& p : cloud->positions) file << p[0] << ' ' << p[1] << ' ' << p[2] << '\n';
  return plain;
}

TEST_F(Assemble, WithoutAModelNeedsNoNormals) {
  const PairFiles plain{without_normals(copy.source), without_normals(copy.reference), copy.truth};
  for (const PairFiles& pair : {copy, plain}) {
    const Finished finished = run(pair, {"--json", "-", "--truth", copy.truth});
    ASSERT_EQ(finished.status, 0) << finished.err;
    const auto json = nlohmann::json::parse(finished.out);
    EXPECT_FALSE(json.contains("model"));
    EXPECT_LE(json["errors"]["rotation_degrees"], 1);
    EXPECT_GT(json["confidence"], 0.5);
  }
}

TEST_F(Assemble, WithoutAModelAsksThoseThatShipWhereSurfacesCannotTell) {
  const PairFiles halves = generate_files(folder, "aircraft", "1024", "20005");
  const std::string json = folder.path("halves.json");
  const Finished finished = run(halves, {"--json", json, "--truth", halves.truth});
  ASSERT_EQ(finished.status, 0) << finished.err;
  EXPECT_THAT(finished.out, HasSubstr("proposed    by aircraft"));
  const auto result = read_json(json);
  EXPECT_EQ(result["proposal"], "aircraft");
  EXPECT_LE(result["errors"]["rotation_degrees"], 20);
  EXPECT_EQ(result["within"]["rotation_degrees"], 20);
}

TEST_F(Assemble, JsonWithoutAModelHasTheKeysThatScriptsDependOn) {
  const Finished finished = run(copy, {"--json", "-"});
  ASSERT_EQ(finished.status, 0) << finished.err;
  const auto json = nlohmann::json::parse(finished.out);
  for (const char* key :
       {"transform", "rotation", "translation", "confidence", "within", "reasons", "evidence", "proposal",
        "alternatives", "spacing", "resolution", "dropped", "backend", "device", "points", "restriction",
        "diagnostics", "refinement", "timing_ms"})
    EXPECT_TRUE(json.contains(key)) << key;
  for (const char* key :
       {"score", "overlap", "residual", "normals", "conflict", "slack", "margin", "support"})
    EXPECT_TRUE(json["evidence"].contains(key)) << key;
  EXPECT_TRUE(json["confidence"].is_number());
  EXPECT_EQ(json["diagnostics"]["status"], "ok");
  EXPECT_EQ(json["points"]["source"], 500);
  const auto fewer = nlohmann::json::parse(run(copy, {"--json", "-", "--points", "400"}).out);
  EXPECT_EQ(fewer["points"]["source"], 400);
  ASSERT_GT(json["alternatives"].size(), 0u);
  for (const auto& other : json["alternatives"]) {
    EXPECT_EQ(other["transform"].size(), 4u);
    EXPECT_LE(other["confidence"], json["confidence"]);
    EXPECT_TRUE(other.contains("proposal"));
  }
}

TEST_F(Assemble, LeavesHolesOutUnlessItIsStrict) {
  const std::string plain = without_normals(copy.source), holed = folder.path("holed.xyz");
  std::ofstream(holed) << "nan nan nan\n" << read_text(plain) << "1 inf 2\n";
  const auto result = [&](const std::string& source) {
    const Finished finished = run({source, copy.reference, {}}, {"--json", "-"});
    EXPECT_EQ(finished.status, 0) << finished.err;
    return nlohmann::json::parse(finished.out);
  };
  const auto with = result(holed);
  EXPECT_EQ(with["dropped"]["source"], 2);
  EXPECT_EQ(with["dropped"]["reference"], 0);
  EXPECT_EQ(with["transform"], result(plain)["transform"]);
  const Finished strict = run({holed, copy.reference, {}}, {"--strict", "-o", folder.path("out.ply")});
  EXPECT_EQ(strict.status, 2);
  EXPECT_THAT(strict.err, HasSubstr("holed.xyz: line 1: point 0: x is nan; coordinates must be finite"));
  EXPECT_FALSE(std::filesystem::exists(folder.path("out.ply")));
}

TEST_F(Assemble, ViewpointsAreThreeNumbers) {
  const Finished good = run(copy, {"--viewpoint", "0,0,5", "--source-viewpoint=-1,2,3.5"});
  EXPECT_EQ(good.status, 0) << good.err;
  for (const std::string bad : {"0,0", "0,0,up", "1,2,3,4", "0,0,inf"}) {
    const Finished finished = run(copy, {"--reference-viewpoint", bad});
    EXPECT_EQ(finished.status, 2) << bad;
    EXPECT_THAT(finished.err, HasSubstr("\"" + bad + "\" is not three numbers"));
  }
}

TEST_F(Assemble, WhatOnlyANetworkUnderstandsNeedsOne) {
  for (const std::vector<std::string>& option : {std::vector<std::string>{"--verify"},
                                                 {"--no-confidence"},
                                                 {"--as-defined"},
                                                 {"--precision", "f64"},
                                                 {"--mode", "reference"},
                                                 {"--neighbors", "tree"},
                                                 {"--profile", folder.path("trace.json")}}) {
    const Finished finished = run(copy, option);
    EXPECT_EQ(finished.status, 2) << option[0];
    EXPECT_THAT(finished.err, HasSubstr(option[0] + ": is about one network")) << finished.err;
  }
}

TEST_F(Assemble, TakesModelsByName) {
  const PairFiles large = generate_files(folder, "copy", "2048");
  for (const ShippedModel& shipped : shipped_models()) {
    const Finished finished = run(large, {"--model", std::string(shipped.name), "--json", "-"});
    EXPECT_EQ(finished.status, 0) << finished.err;
    const auto json = nlohmann::json::parse(finished.out);
    EXPECT_EQ(json["model"], std::string(shipped.name));
    // More than it was trained on.
    EXPECT_LT(json["points"]["source"], 2048);
  }
  const Finished unknown = run(copy, {"--model", "spaceship"});
  EXPECT_EQ(unknown.status, 2);
  EXPECT_THAT(unknown.err, HasSubstr("no model is called spaceship"));
}

TEST_F(Assemble, WarnsWhereCompleteMatchingDoesNotApply) {
  const Finished finished = run(generate_files(folder, "fragments"), {"--complete-match"});
  EXPECT_EQ(finished.status, 0);
  EXPECT_THAT(finished.err, HasSubstr("no moved copy"));
}

TEST_F(Assemble, JsonHasTheKeysThatScriptsDependOn) {
  const Finished finished =
      run(copy, {"--complete-match", "--json", "-", "--truth", copy.truth, "--backend", "cpu"});
  ASSERT_EQ(finished.status, 0) << finished.err;
  const auto json = nlohmann::json::parse(finished.out);
  for (const char* key : {"transform", "rotation", "translation", "model", "backend", "device", "mode",
                          "points", "key_points", "diagnostics", "refinement", "timing_ms"})
    EXPECT_TRUE(json.contains(key)) << key;
  for (const char* key : {"singular_values", "degenerate", "overlap", "inlier_rmse", "inlier_threshold",
                          "swap_residual", "status", "reason", "rotation_gap"})
    EXPECT_TRUE(json["diagnostics"].contains(key)) << key;
  EXPECT_EQ(json["transform"].size(), 4u);
  EXPECT_EQ(json["transform"][3], nlohmann::json({0.0, 0.0, 0.0, 1.0}));
  EXPECT_EQ(json["rotation"].size(), 3u);
  EXPECT_EQ(json["translation"].size(), 3u);
  EXPECT_EQ(json["backend"], "cpu");
  EXPECT_EQ(json["mode"], "scale-exact");
  EXPECT_EQ(json["points"]["source"], 500);
  EXPECT_EQ(json["points"]["reference"], 500);
  EXPECT_EQ(json["key_points"]["source"].size(), 32u);
  EXPECT_EQ(json["key_points"]["reference"][31].size(), 3u);
  EXPECT_EQ(json["diagnostics"]["status"], "ok");
  EXPECT_EQ(json["diagnostics"]["degenerate"], false);
  EXPECT_EQ(json["diagnostics"]["overlap"], 1.0);
  EXPECT_EQ(json["refinement"], nullptr);
  EXPECT_GT(json["timing_ms"]["total"], json["timing_ms"]["knn"]);
  EXPECT_LE(json["errors"]["rotation_degrees"], 0.1);
}

TEST_F(Assemble, JsonIsTheSameInEveryRunButForTimes) {
  const auto result = [&](const std::string& threads) {
    auto json = nlohmann::json::parse(
        run(copy, {"--complete-match", "--json", "-", "--threads", threads, "--points", "300"}).out);
    json.erase("timing_ms");
    return json.dump();
  };
  const std::string once = result("1");
  EXPECT_EQ(once, result("1"));
  EXPECT_EQ(once, result("2"));
}

TEST_F(Assemble, AssembledCloudIsBothInTheReferencesFrame) {
  const std::string output = folder.path("assembled.ply"), json = folder.path("result.json");
  ASSERT_EQ(run(copy, {"--complete-match", "-o", output, "--json", json}).status, 0);
  const PointCloud joined = io::read_cloud(output).value();
  const PointCloud source = io::read_cloud(copy.source).value(),
                   reference = io::read_cloud(copy.reference).value();
  const Pose pose = pose_of(read_json(json)["transform"]);
  ASSERT_EQ(joined.size(), 1000u);
  ASSERT_EQ(joined.normals.size(), 1000u);
  ASSERT_EQ(joined.colors.size(), 1000u);
  for (std::size_t i = 0; i < 500; ++i) {
    const Vec3d moved = pose.apply(source.positions[i]);
    const Vec3f& n = source.normals[i];
    const Vec3d turned = pose.rotate({n[0], n[1], n[2]});
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_NEAR(joined.positions[i][axis], moved[axis], 1e-12);
      EXPECT_NEAR(joined.normals[i][axis], turned[axis], 1e-6);
    }
    EXPECT_EQ(joined.positions[500 + i], reference.positions[i]);
    EXPECT_EQ(joined.colors[i], joined.colors[0]);
    EXPECT_EQ(joined.colors[500 + i], joined.colors[500]);
  }
  EXPECT_NE(joined.colors[0], joined.colors[500]);
}

TEST_F(Assemble, PictureIsAPngAndChangesNothingElse) {
  const auto result = [&](std::vector<std::string> options) {
    options.insert(options.end(), {"--complete-match", "--json", "-"});
    const Finished finished = run(copy, options);
    EXPECT_EQ(finished.status, 0) << finished.err;
    auto json = nlohmann::json::parse(finished.out);
    json.erase("timing_ms");
    return json.dump();
  };
  const std::string image = folder.path("a.png"), again = folder.path("b.png");
  EXPECT_EQ(result({"--image", image}), result({}));
  result({"--image", again, "--threads", "1"});
  const std::string bytes = read_text(image);
  EXPECT_TRUE(bytes.starts_with("\x89PNG\r\n\x1a\n"));
  EXPECT_GT(bytes.size(), 50'000u) << "an empty picture is smaller";
  EXPECT_EQ(bytes, read_text(again));
}

TEST_F(Assemble, KeepsColoursThatBothCloudsHave) {
  PointCloud source = io::read_cloud(copy.source).value(), reference = io::read_cloud(copy.reference).value();
  source.colors.assign(source.size(), {1, 0, 0});
  reference.colors.assign(reference.size(), {0, 1, 0});
  const PairFiles colored = {folder.path("red.ply"), folder.path("green.ply"), {}};
  ASSERT_TRUE(io::write_ply(colored.source, source));
  ASSERT_TRUE(io::write_ply(colored.reference, reference));
  ASSERT_EQ(run(colored, {"--complete-match", "-o", folder.path("both.ply")}).status, 0);
  const PointCloud joined = io::read_cloud(folder.path("both.ply")).value();
  EXPECT_EQ(joined.colors.front(), (Vec3f{1, 0, 0}));
  EXPECT_EQ(joined.colors.back(), (Vec3f{0, 1, 0}));
}

TEST_F(Assemble, SamplesMeshesOfTheSameShapeAtTheSamePoints) {
  // A tetrahedron with four different edges, and the same one moved by half a turn about z and along x.
  const std::string tail = "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n";
  const PairFiles mesh = {folder.write("a.obj", "v 0 0 0\nv 3 0 0\nv 0 2 0\nv 0.5 0.3 1\n" + tail),
                          folder.write("b.obj", "v 5 0 0\nv 2 0 0\nv 5 -2 0\nv 4.5 -0.3 1\n" + tail),
                          {}};
  const Finished finished = run(mesh, {"--complete-match", "--points", "400", "--json", "-"});
  ASSERT_EQ(finished.status, 0) << finished.err;
  const auto json = nlohmann::json::parse(finished.out);
  EXPECT_EQ(json["points"]["source"], 400);
  EXPECT_LE(rotation_error_degrees(pose_of(json["transform"]), {{-1, 0, 0, 0, -1, 0, 0, 0, 1}, {5, 0, 0}}),
            0.1);
}

TEST_F(Assemble, VerifyComparesEveryStage) {
  const Finished finished = run(copy, {"--complete-match", "--verify", "--json", folder.path("v.json")});
  EXPECT_EQ(finished.status, 0) << finished.err;
  EXPECT_THAT(finished.out, HasSubstr("out.R"));
  EXPECT_THAT(finished.out, Not(HasSubstr("BEYOND")));
  EXPECT_GT(read_json(folder.path("v.json"))["verification"].size(), 5u);
}

TEST_F(Assemble, AsDefinedAndDoublePrecisionAgreeWithTheRest) {
  const auto pose = [&](std::vector<std::string> options) {
    options.insert(options.end(), {"--complete-match", "--json", "-"});
    const Finished finished = run(copy, options);
    EXPECT_EQ(finished.status, 0) << finished.err;
    return pose_of(nlohmann::json::parse(finished.out)["transform"]);
  };
  const Pose folded = pose({});
  EXPECT_LE(rotation_error_degrees(folded, pose({"--precision", "f64"})), 0.02);
  EXPECT_LE(rotation_error_degrees(folded, pose({"--precision", "f64", "--as-defined"})), 0.02);
}

TEST_F(Assemble, StrictRefusesAPoseThatIsNotDetermined) {
  // Points on a line: a turn about it changes nothing.
  std::string line;
  for (int i = 0; i < 100; ++i) line += std::to_string(i + 0.3 * std::sin(i)) + " 0 0\n";
  const PairFiles pair = {folder.write("line.xyz", line), folder.write("line_too.xyz", line), {}};
  const std::string output = folder.path("line.ply"), json = folder.path("line.json");
  const Finished lenient = run(pair, {"--complete-match", "-o", output});
  EXPECT_EQ(lenient.status, 0) << lenient.err;
  EXPECT_THAT(lenient.err, HasSubstr("not determined"));
  EXPECT_THAT(lenient.out, HasSubstr("degenerate"));
  std::filesystem::remove(output);
  const Finished strict = run(pair, {"--complete-match", "--strict", "-o", output, "--json", json});
  EXPECT_EQ(strict.status, 1);
  EXPECT_THAT(strict.err, HasSubstr("not determined"));
  EXPECT_FALSE(std::filesystem::exists(output));
  EXPECT_FALSE(std::filesystem::exists(json));
}

TEST_F(Assemble, SaysHowFarThePoseCanBeTrusted) {
  const PairFiles pair = generate_files(folder, "aircraft", "600", "4");
  const std::string first = folder.path("first.json"), again = folder.path("again.json");
  const auto with = [&](std::vector<std::string> options, const std::string& json) {
    options.insert(options.end(), {"--model", "aircraft", "--backend", "cpu", "--json", json});
    return run(pair, options);
  };
  const Finished finished = with({}, first);
  ASSERT_EQ(finished.status, 0) << finished.err;
  EXPECT_THAT(finished.out, HasSubstr("confidence  "));
  const auto plain = read_json(first);
  EXPECT_GT(plain["confidence"], 0.5);
  EXPECT_LE(plain["confidence"], 1);
  EXPECT_GT(plain["evidence"]["rotation_spread"], 0);
  EXPECT_TRUE(plain["evidence"]["refined_by"].is_null());
  ASSERT_EQ(with({"--threads", "1", "--refine"}, again).status, 0);
  const auto refined = read_json(again);
  EXPECT_EQ(refined["evidence"]["rotation_spread"], plain["evidence"]["rotation_spread"]);
  EXPECT_NEAR(refined["evidence"]["score"], refined["refinement"]["score_after"], 1e-9);
  ASSERT_EQ(with({"--no-confidence"}, again).status, 0);
  EXPECT_TRUE(read_json(again)["confidence"].is_null());
  EXPECT_EQ(read_json(again)["transform"], read_json(first)["transform"]);
}

TEST_F(Assemble, PoseIsTheMeanOfSeveralAnswers) {
  const PairFiles pair = generate_files(folder, "aircraft", "600", "4");
  const auto result = [&](std::vector<std::string> options) {
    const std::string json = folder.path("answers.json");
    if (options.empty() || options[0] != "--complete-match")
      options.insert(options.end(), {"--model", "aircraft"});
    options.insert(options.end(), {"--backend", "cpu", "--no-confidence", "--json", json});
    EXPECT_EQ(run(pair, options).status, 0);
    return read_json(json);
  };
  const auto usual = result({}), one = result({"--answers", "0"}), few = result({"--answers", "2"});
  EXPECT_EQ(usual["answers"], 9);
  EXPECT_EQ(few["answers"], 3);
  EXPECT_EQ(one["answers"], 1);
  EXPECT_EQ(result({"--complete-match"})["answers"], 1);
  EXPECT_NE(few["transform"], usual["transform"]);
  EXPECT_LT(rotation_error_degrees(pose_of(usual["transform"]), pose_of(one["transform"])), 20);
  // The rest tells of the clouds as they are.
  EXPECT_EQ(usual["diagnostics"]["rotation_gap"], one["diagnostics"]["rotation_gap"]);

  // Swapped clouds have the inverse pose.
  const std::string json = folder.path("swapped.json");
  ASSERT_EQ(
      run({pair.reference, pair.source, {}}, {"--model", "aircraft", "--backend", "cpu", "--json", json})
          .status,
      0);
  const Pose swapped = pose_of(read_json(json)["transform"]);
  EXPECT_LT(rotation_error_degrees(swapped.inverse(), pose_of(usual["transform"])), 0.05);
  EXPECT_LT(translation_error(swapped.inverse(), pose_of(usual["transform"])), 1e-3);

  for (const std::string odd : {"7", "-2", "102"}) {
    const Finished wrong = run(pair, {"--answers=" + odd});
    EXPECT_EQ(wrong.status, 2);
    EXPECT_THAT(wrong.err, HasSubstr("--answers " + odd + ": is not an even number in 0 … 100"));
  }
}

TEST_F(Assemble, StrictRefusesLittleConfidence) {
  // A nose and somebody else's tail have nothing to do with each other.
  const PairFiles one = generate_files(folder, "copy", "400", "4"),
                  other = generate_files(folder, "aircraft", "400", "9");
  const PairFiles pair = {one.source, other.reference, {}};
  const std::string output = folder.path("together.ply");
  const Finished refused = run(pair, {"--strict", "--least-confidence", "0.99", "-o", output});
  EXPECT_EQ(refused.status, 1);
  EXPECT_THAT(refused.err, HasSubstr("is below 0.99"));
  EXPECT_FALSE(std::filesystem::exists(output));
  const Finished lenient = run(pair, {"--strict", "--least-confidence", "0", "-o", output});
  EXPECT_EQ(lenient.status, 0) << lenient.err;
  const Finished wrong = run(pair, {"--strict", "--least-confidence", "1.5"});
  EXPECT_EQ(wrong.status, 2);
  EXPECT_THAT(wrong.err, HasSubstr("--least-confidence 1.5: is not in 0 … 1"));
}

}  // namespace
}  // namespace bitr::test
