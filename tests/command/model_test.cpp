#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "run_command.hpp"
#include "support/paths.hpp"

namespace bitr::test {
namespace {

using testing::HasSubstr;

const std::string golden = data_dir().string() + "/golden/";

TEST(Model, ConvertThenInfoThenAssemble) {
  const Folder folder;
  const std::string weights = folder.path("official.safetensors");
  const Finished converted = run_command(
      {"model", "convert", golden + "checkpoint_00_state_dict.pt", weights, "--mode", "scale-exact"});
  ASSERT_EQ(converted.status, 0) << converted.err;

  const Finished info = run_command({"model", "info", weights, "--json", "-"});
  ASSERT_EQ(info.status, 0) << info.err;
  const auto json = nlohmann::json::parse(info.out);
  EXPECT_EQ(json["parameters"], 161316);
  EXPECT_EQ(json["mode"], "scale-exact");
  EXPECT_EQ(json["name"], "official");
  EXPECT_EQ(json["config"]["num_key_points"], 32);
  EXPECT_TRUE(json.contains("metadata"));
  const Finished text = run_command({"model", "info", weights});
  EXPECT_THAT(text.out, HasSubstr("161316"));
  EXPECT_THAT(text.out, HasSubstr("k_neighbor"));

  const PairFiles pair = generate_files(folder, "copy", "200");
  const Finished assembled =
      run_command({"assemble", pair.source, pair.reference, "--model", weights, "--json", "-"});
  ASSERT_EQ(assembled.status, 0) << assembled.err;
  const auto result = nlohmann::json::parse(assembled.out);
  EXPECT_EQ(result["model"], "official");
  EXPECT_EQ(result["complete_match"], false);
}

TEST(Model, HalvesWeights) {
  const Folder folder;
  const std::string whole = golden + "weights_01.safetensors", half = folder.path("half.safetensors");
  const Finished converted = run_command({"model", "convert", whole, half, "--half"});
  ASSERT_EQ(converted.status, 0) << converted.err;
  EXPECT_LT(10 * std::filesystem::file_size(half), 6 * std::filesystem::file_size(whole));

  const PairFiles pair = generate_files(folder, "copy", "200");
  const auto rotation = [&](const std::string& weights) {
    const Finished assembled = run_command({"assemble", pair.source, pair.reference, "--model", weights,
                                            "--mode", "scale-exact", "--answers", "0", "--json", "-"});
    EXPECT_EQ(assembled.status, 0) << assembled.err;
    return nlohmann::json::parse(assembled.out)["rotation"].get<std::array<std::array<double, 3>, 3>>();
  };
  const auto exact = rotation(whole), rounded = rotation(half);
  EXPECT_NE(exact, rounded);
  for (int i = 0; i < 9; ++i) EXPECT_NEAR(exact[i / 3][i % 3], rounded[i / 3][i % 3], 0.05);
}

TEST(Model, RefusesWhatIsNoModel) {
  const Folder folder;
  const std::string junk = folder.write("junk.pt", "PK and then nothing"),
                    junk_weights = folder.write("junk.safetensors", "and nothing"),
                    out = folder.path("out.safetensors");
  const std::vector<std::vector<std::string>> wrong = {
      {"convert", junk, out},
      {"convert", folder.path("none.pt"), out},
      {"convert", junk_weights, out},
      {"convert", golden + "checkpoint_00_state_dict.pt", folder.path("none/out.safetensors")},
      {"convert", golden + "checkpoint_00_state_dict.pt", out, "--mode", "best"},
      {"info", junk},
      {"info", folder.path("none.safetensors")},
      {"info", golden + "checkpoint_00_state_dict.pt"},
  };
  for (auto words : wrong) {
    words.insert(words.begin(), "model");
    const Finished finished = run_command(words);
    EXPECT_EQ(finished.status, 2) << testing::PrintToString(words);
    EXPECT_THAT(finished.err, testing::MatchesRegex("bitr: [^\n]*\n"));
    EXPECT_FALSE(std::filesystem::exists(out));
  }
}

}  // namespace
}  // namespace bitr::test
