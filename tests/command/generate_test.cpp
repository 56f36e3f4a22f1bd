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
  EXPECT_THAT(a.names(), ElementsAre("copy_000_reference.ply", "copy_000_source.ply", "copy_000_truth.json"));
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
