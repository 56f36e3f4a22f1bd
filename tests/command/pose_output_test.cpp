// What a pose becomes: a matrix in a text file, the source moved, a pose of a smaller family.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bitr/io.hpp>
#include <bitr/pose.hpp>
#include <cmath>
#include <numbers>
#include <sstream>

#include "run_command.hpp"

namespace bitr::test {
namespace {

using testing::HasSubstr;
using testing::Not;

Pose pose_of(const std::array<double, 16>& m) {
  return {{m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]}, {m[3], m[7], m[11]}};
}
Pose pose_of(const nlohmann::json& rows) {
  std::array<double, 16> m{};
  for (std::size_t i = 0; i < 16; ++i) m[i] = rows[i / 4][i % 4];
  return pose_of(m);
}

nlohmann::json rows_of(const Pose& pose) {
  const auto m = pose.matrix();
  nlohmann::json rows;
  for (std::size_t i = 0; i < 16; i += 4) rows.push_back({m[i], m[i + 1], m[i + 2], m[i + 3]});
  return rows;
}

/// As a reader of plain tables takes it: rows and columns of numbers.
std::array<double, 16> table_of(const std::string& path) {
  std::istringstream lines(read_text(path));
  std::array<double, 16> m{};
  std::size_t count = 0, rows = 0;
  for (std::string line; std::getline(lines, line); ++rows) {
    std::istringstream words(line);
    for (std::string word; words >> word; ++count)
      if (count < 16) m[count] = std::stod(word);
    EXPECT_EQ(count, 4 * (rows + 1));
  }
  EXPECT_EQ(rows, 4u);
  return m;
}

class PoseOutput : public testing::Test {
 protected:
  Finished run(const std::string& command, std::vector<std::string> options) const {
    options.insert(options.begin(), {command, copy.source, copy.reference});
    return run_command(options);
  }
  nlohmann::json assembled(std::vector<std::string> options, const std::string& source = {},
                           const std::string& reference = {}) const {
    options.insert(options.begin(),
                   {"assemble", source.empty() ? copy.source : source,
                    reference.empty() ? copy.reference : reference, "--complete-match", "--json", "-"});
    const Finished finished = run_command(options);
    EXPECT_EQ(finished.status, 0) << finished.err;
    return nlohmann::json::parse(finished.out, nullptr, false);
  }
  Folder folder;
  PairFiles copy = generate_files(folder, "copy");
};

TEST_F(PoseOutput, TextGivesEveryBitOfTheMatrixBack) {
  const std::string text = folder.path("pose.txt"), json = folder.path("result.json");
  const Finished finished = run("assemble", {"--complete-match", "--pose", text, "--json", json});
  ASSERT_EQ(finished.status, 0) << finished.err;
  const auto matrix = read_json(json)["transform"];
  const auto read = table_of(text);
  for (std::size_t i = 0; i < 16; ++i) EXPECT_EQ(read[i], double{matrix[i / 4][i % 4]}) << i;

  // The same where refine starts from, and where it ends.
  const std::string again = folder.path("again.txt"), truth = folder.path("refined.json");
  const Finished refined = run("refine", {"--pose", text, "--pose-out", again, "--json", truth, "--protocol",
                                          "default", "--truth", text});
  ASSERT_EQ(refined.status, 0) << refined.err;
  EXPECT_EQ(read_json(truth)["refinement"]["before"], matrix);
  const auto end = table_of(again);
  for (std::size_t i = 0; i < 16; ++i) EXPECT_EQ(end[i], double{read_json(truth)["transform"][i / 4][i % 4]});
}

TEST_F(PoseOutput, ReadsTablesOfNumbersAndRefusesOthers) {
  const auto starts = [&](const std::string& content) {
    return run("refine", {"--pose", folder.write("start.txt", content), "--protocol", "default"});
  };
  EXPECT_EQ(starts("# by hand\n1 0 0 .5\n 0 1 0 0\r\n0 0 1 0\n\n0 0 0 1").status, 0);
  for (const char* bad :
       {"", "1 0 0 0\n0 1 0 0\n0 0 1 0\n", "1 0 0 0 0\n", "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 x",
        "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n0 0 0 1\n"}) {
    const Finished finished = starts(bad);
    EXPECT_EQ(finished.status, 2) << bad;
    EXPECT_THAT(finished.err,
                HasSubstr("start.txt: is neither a JSON object nor four lines of four numbers"));
  }
  EXPECT_THAT(starts("2 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n").err, HasSubstr("is no rigid motion"));
}

TEST_F(PoseOutput, TheSourceKeepsItsFormatAndAllThatItHas) {
  // Text, with columns of its own.
  const PointCloud cloud = io::read_cloud(copy.source).value();
  std::string csv = "x,y,z,name,nx,ny,nz\r\n";
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const Vec3d& p = cloud.positions[i];
    const Vec3f& n = cloud.normals[i];
    std::ostringstream row;
    row.precision(17);
    row << p[0] << ',' << p[1] << ',' << p[2] << ",point" << i << ',' << n[0] << ',' << n[1] << ',' << n[2];
    csv += row.str() + "\r\n";
  }
  const std::string source = folder.write("source.csv", csv), applied = folder.path("applied.csv");
  const auto result = assembled({"--applied", applied}, source);
  const Pose pose = pose_of(result["transform"]);
  const auto expected =
      io::moved_geometry(std::as_bytes(std::span(csv)), io::CloudFormat::text, "source.csv", pose).value();
  const std::string text = read_text(applied);
  ASSERT_EQ(text.size(), expected.size());
  EXPECT_EQ(std::memcmp(text.data(), expected.data(), text.size()), 0);
  const PointCloud reference = io::read_cloud(copy.reference).value(),
                   moved = io::read_cloud(applied).value();
  for (std::size_t i = 0; i < cloud.size(); ++i)
    for (int a = 0; a < 3; ++a) EXPECT_NEAR(moved.positions[i][a], reference.positions[i][a], 2e-3);

  const Finished refined = run("refine", {"--pose", copy.truth, "--applied", folder.path("refined.ply")});
  EXPECT_EQ(refined.status, 0) << refined.err;
  EXPECT_EQ(io::read_cloud(folder.path("refined.ply"))->size(), cloud.size());
}

TEST_F(PoseOutput, WhatCannotBeWrittenIsFoundOutBefore) {
  const std::string integers =
      folder.write("integers.ply",
                   "ply\nformat ascii 1.0\nelement vertex 1\nproperty int x\nproperty int y\n"
                   "property int z\nend_header\n1 2 3\n");
  const auto names = folder.names();
  const auto refuses = [&](std::vector<std::string> words, const std::string& why, bool before = true) {
    const Finished finished = run_command(words);
    EXPECT_EQ(finished.status, 2) << why;
    EXPECT_EQ(finished.out.empty(), before);
    EXPECT_THAT(finished.err, HasSubstr(why));
    EXPECT_EQ(folder.names(), names);
  };
  for (const std::string command : {"assemble", "refine"}) {
    const auto words = [&](const std::string& source, const std::string& applied) {
      return std::vector<std::string>{command, source, copy.reference, "--applied", applied};
    };
    refuses(words(copy.source, folder.path("moved.pcd")), "extension \".pcd\" is not that of");
    refuses(words(copy.source, copy.source), "would replace an input");
    refuses(words(copy.source, "-"), "a cloud needs a file");
    refuses(words(integers, folder.path("moved.ply")), "integer type");
    const std::string pose = command == "refine" ? "--pose-out" : "--pose";
    refuses({command, copy.source, copy.reference, pose, "-"}, "a pose needs a file");
    refuses({command, copy.source, copy.reference, pose, folder.path("a"), "--json", folder.path("./a")},
            "is the file of " + pose + " too");
    // Files that were made before another failed are taken back.
    refuses({command, copy.source, copy.reference, pose, folder.path("pose.txt"), "--applied",
             folder.path("moved.ply"), "-o", folder.path("both.ply"), "--json", "/dev/full"},
            "/dev/full", false);
  }
}

// The rotation of a family that is nearest, looked for without any formula for it.
Pose turned(const Vec3d& n, double angle) {
  const double c = std::cos(angle / 2), s = std::sin(angle / 2);
  const double w = c, x = s * n[0], y = s * n[1], z = s * n[2];
  return {{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), 2 * (x * y + w * z),
           1 - 2 * (x * x + z * z), 2 * (y * z - w * x), 2 * (x * z - w * y), 2 * (y * z + w * x),
           1 - 2 * (x * x + y * y)},
          {0, 0, 0}};
}
double distance(const Pose& a, const Pose& b) {
  double sum = 0;
  for (int i = 0; i < 9; ++i) sum += (a.rotation[i] - b.rotation[i]) * (a.rotation[i] - b.rotation[i]);
  return std::sqrt(sum);
}

Vec3d centroid_of(const std::string& path) {
  const PointCloud cloud = io::read_cloud(path).value();
  Vec3d centroid{};
  for (const Vec3d& p : cloud.positions)
    for (int a = 0; a < 3; ++a) centroid[a] += p[a] / static_cast<double>(cloud.size());
  return centroid;
}

TEST_F(PoseOutput, RestrictedPosesAreTheNearestOfTheirFamilyAndKeepTheCentroid) {
  const Vec3d centroid = centroid_of(copy.source);
  const Pose whole = pose_of(assembled({})["transform"]);
  const Vec3d goes_to = whole.apply(centroid);
  const auto keeps_centroid = [&](const Pose& pose) {
    for (int a = 0; a < 3; ++a) EXPECT_NEAR(pose.apply(centroid)[a], goes_to[a], 1e-9);
  };

  const auto shift = assembled({"--translation-only"});
  EXPECT_EQ(pose_of(shift["transform"]).rotation, Pose{}.rotation);
  EXPECT_EQ(shift["restriction"], (nlohmann::json{{"family", "translation"}}));
  keeps_centroid(pose_of(shift["transform"]));
  EXPECT_TRUE(assembled({})["restriction"].is_null());

  const double third = 1 / std::sqrt(3.0);
  const std::vector<std::pair<std::string, Vec3d>> axes = {{"--yaw-only", {0, 0, 1}},
                                                           {"--yaw-only=x", {1, 0, 0}},
                                                           {"--yaw-only=y", {0, 1, 0}},
                                                           {"--yaw-only=-2,2,-2", {-third, third, -third}}};
  for (const auto& [option, axis] : axes) {
    const auto result = assembled({option});
    const Pose pose = pose_of(result["transform"]);
    keeps_centroid(pose);
    const auto& restriction = result["restriction"];
    EXPECT_EQ(restriction["family"], "turn");
    for (int a = 0; a < 3; ++a) EXPECT_NEAR(restriction["axis"][a], axis[a], 1e-15);
    EXPECT_LT(distance(pose, turned(axis, double{restriction["turn_degrees"]} * std::numbers::pi / 180)),
              1e-12);
    const double found = distance(pose, whole);
    double least = 10, most = 0;
    for (int i = 0; i < 100'000; ++i) {
      const double d = distance(turned(axis, i * 2 * std::numbers::pi / 100'000), whole);
      least = std::min(least, d), most = std::max(most, d);
    }
    EXPECT_LE(found, least + 1e-9) << option;
    // |S - R|² = 6 - 2 ⟨S, R⟩, and ⟨S, R⟩ varies by the margin on both sides of its mean.
    EXPECT_NEAR((most * most - least * least) / 4, restriction["margin"], 1e-6) << option;
    EXPECT_LT(double{result["diagnostics"]["overlap"]}, 1) << "is of the restricted pose";
  }
}

TEST_F(PoseOutput, ATurnThatIsNotDeterminedIsSaidSo) {
  // Half a turn about x is as far from every turn about z.
  const std::string half = folder.path("half.ply");
  ASSERT_TRUE(io::move_cloud_file(copy.source, half, {{1, 0, 0, 0, -1, 0, 0, 0, -1}, {1, 2, 3}}));
  const auto result = assembled({"--yaw-only=z"}, copy.source, half);
  EXPECT_EQ(result["diagnostics"]["status"], "degenerate");
  EXPECT_THAT(std::string(result["diagnostics"]["reason"]),
              HasSubstr("turn about (0, 0, 1) is not determined"));
  EXPECT_LT(result["restriction"]["margin"], 1e-3);
  EXPECT_EQ(assembled({"--yaw-only=x"}, copy.source, half)["diagnostics"]["status"], "ok");
  const Finished strict = run_command({"assemble", copy.source, half, "--complete-match", "--yaw-only",
                                       "--strict", "--pose", folder.path("pose.txt")});
  EXPECT_EQ(strict.status, 1);
  EXPECT_FALSE(std::filesystem::exists(folder.path("pose.txt")));
}

TEST_F(PoseOutput, RestrictionsThatMakeNoSenseAreRefused) {
  const auto refuses = [&](std::vector<std::string> options, const std::string& why) {
    const Finished finished = run("assemble", options);
    EXPECT_EQ(finished.status, 2) << why;
    EXPECT_THAT(finished.err, HasSubstr(why));
  };
  for (const char* axis : {"w", "0,0,0", "1,2", "1,2,3,4", "1,nan,0", "1,,0", "z,"})
    refuses({std::string("--yaw-only=") + axis},
            std::string("\"") + axis + "\" is not x, y, z or three numbers");
  refuses({"--yaw-only=z", "--translation-only"}, "--translation-only");
}

TEST_F(PoseOutput, RefinementStaysInTheFamilyAndIsNoWorse) {
  // A copy that is only turned about y and shifted, and a start that is off in every way.
  const std::string moved = folder.path("moved.ply"), start = folder.path("start.json");
  const Vec3d y = {0, 1, 0}, oblique = {0.6, 0, 0.8};
  Pose truth = turned(y, 0.7);
  truth.translation = {0.3, -0.2, 0.1};
  ASSERT_TRUE(io::move_cloud_file(copy.source, moved, truth));
  Pose off = turned(oblique, 0.1) * truth * turned(y, 0.05);
  off.translation[1] += 0.02;
  folder.write("start.json", nlohmann::json{{"transform", rows_of(off)}}.dump());
  const Vec3d centroid = centroid_of(copy.source);
  for (const char* method : {"icp", "ot"}) {
    const Finished finished = run_command({"refine", copy.source, moved, "--pose", start, "--method", method,
                                           "--protocol", "default", "--yaw-only=y", "--json", "-"});
    ASSERT_EQ(finished.status, 0) << finished.err;
    EXPECT_THAT(finished.err, HasSubstr("restricted  to a turn of "));
    const auto result = nlohmann::json::parse(finished.out);
    const Pose pose = pose_of(result["transform"]), before = pose_of(result["refinement"]["before"]);
    const double angle = double{result["restriction"]["turn_degrees"]} * std::numbers::pi / 180;
    EXPECT_LT(distance(pose, turned(y, angle)), 1e-12);
    EXPECT_NEAR(before.rotation[4], 1, 1e-12) << "the start is of the family too";
    for (int a = 0; a < 3; ++a) EXPECT_NEAR(before.apply(centroid)[a], off.apply(centroid)[a], 1e-9);
    EXPECT_EQ(result["refinement"]["kept"], "after");
    EXPECT_GT(result["refinement"]["score_after"], result["refinement"]["score_before"]);
    EXPECT_LT(rotation_error_degrees(pose, truth), 0.5) << method;
    EXPECT_LT(translation_error(pose, truth), 0.01) << method;
  }
  // What cannot get better stays as it was.
  const Finished kept = run_command({"refine", copy.source, moved, "--pose", start, "--protocol", "default",
                                     "--translation-only", "--json", "-"});
  ASSERT_EQ(kept.status, 0) << kept.err;
  EXPECT_EQ(pose_of(nlohmann::json::parse(kept.out)["transform"]).rotation, Pose{}.rotation);
  const auto assembled_so = assembled({"--yaw-only=y", "--refine"}, copy.source, moved);
  EXPECT_NEAR(assembled_so["restriction"]["turn_degrees"], 0.7 * 180 / std::numbers::pi, 0.1);
  EXPECT_NEAR(pose_of(assembled_so["transform"]).rotation[4], 1, 1e-12);
  EXPECT_EQ(assembled_so["refinement"]["method"], "icp");

  const std::string half = folder.write("half.txt", "1 0 0 0\n0 -1 0 0\n0 0 -1 0\n0 0 0 1\n");
  const Finished refused = run_command({"refine", copy.source, moved, "--pose", half, "--yaw-only=z"});
  EXPECT_EQ(refused.status, 2);
  EXPECT_THAT(refused.err, HasSubstr("half.txt: the turn about (0, 0, 1) is not determined"));
}

TEST_F(PoseOutput, ABatchRestrictsToo) {
  const std::string manifest =
      folder.write("pairs.csv", "source,reference\n" + copy.source + "," + copy.reference);
  const Finished finished =
      run_command({"batch", manifest, "--out", folder.path("results"), "--complete-match", "--yaw-only=y"});
  ASSERT_EQ(finished.status, 0) << finished.err;
  std::istringstream lines(read_text(folder.path("results/results.jsonl")));
  std::string settings, line;
  std::getline(lines, settings);
  std::getline(lines, line);
  EXPECT_EQ(nlohmann::json::parse(settings)["restriction"]["axis"], (nlohmann::json{0, 1, 0}));
  const auto alone = assembled({"--yaw-only=y"});
  EXPECT_EQ(nlohmann::json::parse(line)["transform"], alone["transform"]);
  EXPECT_EQ(nlohmann::json::parse(line)["restriction"], alone["restriction"]);
  EXPECT_EQ(nlohmann::json::parse(line)["diagnostics"]["overlap"], alone["diagnostics"]["overlap"]);
}

}  // namespace
}  // namespace bitr::test
