#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "run_command.hpp"

namespace bitr::test {
namespace {

using testing::HasSubstr;

const std::string golden = std::string(BITR_TEST_DATA) + "/golden/";

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

TEST(Model, RefusesWhatIsNoModel) {
  const Folder folder;
  const std::string junk = folder.write("junk.pt", "PK and then nothing"),
                    out = folder.path("out.safetensors");
  const std::vector<std::vector<std::string>> wrong = {
      {"convert", junk, out},
      {"convert", folder.path("none.pt"), out},
      {"convert", golden + "weights_01.safetensors", out},
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
