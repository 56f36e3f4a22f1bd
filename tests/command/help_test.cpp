#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "run_command.hpp"

namespace bitr::test {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

using Words = std::vector<std::string>;

TEST(Help, EveryCommandExplainsItselfWithAnExample) {
  const std::vector<Words> commands = {{},         {"assemble"}, {"refine"},        {"generate"},
                                       {"train"},  {"eval"},     {"bench"},         {"devices"},
                                       {"doctor"}, {"model"},    {"model", "info"}, {"model", "convert"},
                                       {"batch"},  {"help"},     {"completion"}};
  for (Words words : commands) {
    const std::string name = testing::PrintToString(words);
    words.push_back("--help");
    const Finished help = run_command(words);
    EXPECT_EQ(help.status, 0) << name;
    EXPECT_THAT(help.out, HasSubstr("Usage:")) << name;
    EXPECT_THAT(help.out, HasSubstr("Example")) << name;
    EXPECT_EQ(help.err, "") << name;
  }
}

TEST(Help, VersionIsOneLine) {
  const Finished version = run_command({"--version"});
  EXPECT_EQ(version.status, 0);
  EXPECT_THAT(version.out, testing::MatchesRegex("bitr [0-9]+\\.[0-9]+\\.[0-9]+\n"));
}

TEST(Help, WhatItDoesNotKnowIsStatusTwoAndOneLine) {
  const std::vector<Words> wrong = {
      {},
      {"asemble"},
      {"--frobnicate"},
      {"assemble"},
      {"assemble", "only_one.ply"},
      {"assemble", "a.ply", "b.ply", "--frobnicate"},
      {"assemble", "a.ply", "b.ply", "c.ply"},
      {"generate", "copy"},
      {"model"},
      {"model", "inform"},
      {"model", "info"},
      {"model", "convert", "in.pt"},
      {"bench"},
      {"devices", "0"},
      {"doctor", "--frobnicate"},
      {"doctor", "--backend", "abacus"},
  };
  for (const Words& words : wrong) {
    const Finished finished = run_command(words);
    EXPECT_EQ(finished.status, 2) << testing::PrintToString(words);
    EXPECT_THAT(finished.err, StartsWith("bitr: "));
    EXPECT_EQ(std::count(finished.err.begin(), finished.err.end(), '\n'), 1) << finished.err;
    EXPECT_EQ(finished.out, "");
  }
}

}  // namespace
}  // namespace bitr::test
