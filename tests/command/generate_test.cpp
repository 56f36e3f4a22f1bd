#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bitr/generate.hpp>
#include <bitr/io.hpp>

#include "run_command.hpp"

namespace bitr::test {
namespace {

using testing::ElementsAre;

TEST(Generate, WritesAPairAndItsTruth) {
  const Folder folder;
  const Finished made = run_command({"generate", "fragments", "--out", folder.path("new/deep"), "--count",
                                     "2", "--seed", "7", "--points", "100", "--noise", "0.001"});
  ASSERT_EQ(made.status, 0) << made.err;
  EXPECT_EQ(made.err, "");
  const std::string name = folder.path("new/deep/fragments_001_");

  const GeneratedPair expected =
      generate_pair("fragments", {.points = 100, .noise = 0.001, .seed = 8}).value();
  const PointCloud source = io::read_cloud(name + "source.ply").value();
  EXPECT_EQ(source.positions, expected.source.positions);
  EXPECT_EQ(source.normals, expected.source.normals);
  EXPECT_EQ(io::read_cloud(name + "reference.ply").value().positions, expected.reference.positions);

  const auto truth = read_json(name + "truth.json");
  EXPECT_EQ(truth["kind"], "fragments");
  EXPECT_EQ(truth["seed"], 8);
  const auto matrix = expected.T_reference_source.matrix();
  for (std::size_t i = 0; i < 16; ++i) EXPECT_EQ(truth["T_reference_source"][i / 4][i % 4], matrix[i]);
}

TEST(Generate, SameSeedSameBytes) {
  const Folder a, b;
  const PairFiles first = generate_files(a, "copy"), second = generate_files(b, "copy");
  EXPECT_EQ(read_text(first.source), read_text(second.source));
  EXPECT_EQ(read_text(first.reference), read_text(second.reference));
  EXPECT_EQ(read_text(first.truth), read_text(second.truth));
  EXPECT_THAT(a.names(), ElementsAre("copy.jsonl", "copy_000_reference.ply", "copy_000_source.ply",
                                     "copy_000_truth.json"));
}

TEST(Generate, WritesAsciiWhenAsked) {
  const Folder folder;
  ASSERT_EQ(
      run_command({"generate", "copy", "--out", folder.path(), "--points", "30", "--format", "ply-ascii"})
          .status,
      0);
  EXPECT_THAT(read_text(folder.path("copy_000_source.ply")), testing::HasSubstr("format ascii 1.0"));
  EXPECT_EQ(io::read_cloud(folder.path("copy_000_source.ply")).value().size(), 30u);
}

TEST(Generate, CropsByAProtocol) {
  const Folder folder;
  const Finished made =
      run_command({"generate", "aircraft", "--out", folder.path(), "--points", "200", "--protocol",
                   "independent", "--share", "0.6", "--noise", "0.01", "--seed", "4"});
  ASSERT_EQ(made.status, 0) << made.err;
  const GeneratedPair expected =
      generate_pair(
          "aircraft",
          {.points = 200, .noise = 0.01, .seed = 4, .protocol = Protocol::independent, .share = 0.6})
          .value();
  EXPECT_EQ(io::read_cloud(folder.path("aircraft_000_source.ply")).value().positions,
            expected.source.positions);
  EXPECT_EQ(expected.source.size(), 120u);
  const auto truth = read_json(folder.path("aircraft_000_truth.json"));
  EXPECT_EQ(truth["protocol"], "independent");
  EXPECT_EQ(truth["share"], 0.6);
  EXPECT_EQ(truth["overlap"], expected.overlap);
  EXPECT_EQ(truth["symmetry"]["order"], 1);
}

TEST(Generate, CropsShapesFromAFolder) {
  const Folder shapes, folder;
  const PairFiles files = generate_files(shapes, "copy", "400");
  shapes.write("broken.ply", "ply\n");
  const Finished made =
      run_command({"generate", "crops", "--shapes", shapes.path(), "--out", folder.path(), "--count", "6",
                   "--points", "100", "--protocol", "complement", "--share", "0.5"});
  ASSERT_EQ(made.status, 0) << made.err;
  EXPECT_THAT(made.err, testing::MatchesRegex("bitr: [^\n]*1 file was skipped; broken.ply: [^\n]*\n"));
  EXPECT_EQ(folder.names().size(), 19u);
  const auto truth = read_json(folder.path("crops_005_truth.json"));
  EXPECT_THAT(truth["shape"].get<std::string>(), testing::StartsWith("copy_000_"));
  EXPECT_EQ(truth["protocol"], "complement");
  EXPECT_EQ(truth["overlap"], 0);
  const PointCloud source = io::read_cloud(folder.path("crops_005_source.ply")).value();
  EXPECT_LE(source.size(), 50u);
  EXPECT_GE(source.size(), 35u);

  EXPECT_TRUE(io::read_cloud(folder.path("crops_005_source.ply")).value().normals.empty());

  const Folder again;
  ASSERT_EQ(run_command({"generate", "crops", "--shapes", shapes.path(), "--out", again.path(), "--points",
                         "100", "--protocol", "complement", "--share", "0.5"})
                .status,
            0);
  EXPECT_EQ(read_text(again.path("crops_000_source.ply")), read_text(folder.path("crops_000_source.ply")));

  // One file, with its normals.
  ASSERT_EQ(run_command({"generate", "crops", "--shapes", files.source, "--out", again.path("one"),
                         "--points", "100", "--normals"})
                .status,
            0);
  EXPECT_EQ(read_json(again.path("one/crops_000_truth.json"))["shape"], "copy_000_source.ply");
  EXPECT_EQ(io::read_cloud(again.path("one/crops_000_source.ply")).value().normals.size(), 70u);
}

TEST(Generate, RefusesWithoutWriting) {
  const std::vector<std::vector<std::string>> wrong = {
      {"planes"},
      {"copy", "--points", "0"},
      {"copy", "--points", "-5"},
      {"copy", "--points", "12x"},
      {"copy", "--count", "0"},
      {"copy", "--seed", "18446744073709551616"},
      {"copy", "--noise", "-0.1"},
      {"copy", "--noise", "nan"},
      {"copy", "--noise", "much"},
      {"copy", "--roughness", "0.5"},
      {"copy", "--format", "obj"},
      {"aircraft", "--protocol", "random"},
      {"aircraft", "--share", "1.5"},
      {"aircraft", "--share", "half"},
      {"vessels", "--share", "0.5"},
      {"vessels", "--protocol", "complement", "--share", "1"},
      {"vessels", "--shapes", "/tmp"},
      {"vessels", "--normals"},
      {"crops"},
      {"crops", "--shapes", "/nowhere/at/all"},
  };
  for (const auto& options : wrong) {
    const Folder folder;
    std::vector<std::string> words = {"generate", "--out", folder.path()};
    words.insert(words.end(), options.begin(), options.end());
    const Finished finished = run_command(words);
    EXPECT_EQ(finished.status, 2) << testing::PrintToString(options);
    EXPECT_THAT(finished.err, testing::MatchesRegex("bitr: [^\n]*\n"));
    EXPECT_THAT(folder.names(), testing::IsEmpty());
  }
  const Folder folder;
  const std::string file = folder.write("file", "");
  const Finished finished = run_command({"generate", "copy", "--out", file + "/below"});
  EXPECT_EQ(finished.status, 2);
  EXPECT_THAT(finished.err, testing::HasSubstr(file + "/below"));
}

}  // namespace
}  // namespace bitr::test
