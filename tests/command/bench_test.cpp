#include <gtest/gtest.h>

#include "run_command.hpp"

namespace bitr::test {
namespace {

TEST(Bench, ForwardPassesAsJson) {
  const Finished finished =
      run_command({"bench", "--model-forward", "--points", "64", "--pairs", "2", "--repeats", "3",
                   "--threads", "1", "--json", "-", "--backend", "cpu"});
  ASSERT_EQ(finished.status, 0) << finished.err;
  const auto json = nlohmann::json::parse(finished.out);
  for (const char* key : {"median_ms", "min_ms", "p90_ms", "pairs_per_s", "stages_ms", "operations",
                          "workspace_bytes", "arena_bytes", "dispatches", "barriers", "peak_rss_bytes",
                          "baseline_rss_bytes", "device", "threads", "precision", "points", "pairs"})
    EXPECT_TRUE(json.contains(key)) << key;
  EXPECT_LE(json["min_ms"], json["median_ms"]);
  EXPECT_LE(json["median_ms"], json["p90_ms"]);
  EXPECT_GT(json["operations"], 0);
  EXPECT_GT(json["workspace_bytes"], 0);
  EXPECT_GE(json["peak_rss_bytes"], json["baseline_rss_bytes"]);
  EXPECT_EQ(json["threads"], 1);
  EXPECT_EQ(json["backend"], "cpu");
  EXPECT_EQ(json["dispatches"], nullptr);
  EXPECT_FALSE(json["stages_ms"].empty());
}

TEST(Bench, RefusesWhatItCannotMeasure) {
  EXPECT_EQ(run_command({"bench"}).status, 2);
  EXPECT_EQ(run_command({"bench", "--model-forward", "--points", "5"}).status, 2);
  EXPECT_EQ(run_command({"bench", "--model-forward", "--pairs", "0"}).status, 2);
  EXPECT_EQ(run_command({"bench", "--model-forward", "--repeats", "0"}).status, 2);
  EXPECT_EQ(run_command({"bench", "--model-forward", "--profile", "-"}).status, 2);
}

}  // namespace
}  // namespace bitr::test
