#include <gtest/gtest.h>

#include <bitr/evaluate.hpp>

#include "core/random.hpp"

namespace bitr {
namespace {

std::vector<Judgement> some(std::uint64_t seed, std::size_t count, int levels) {
  Random random(seed);
  std::vector<Judgement> judgements(count);
  for (Judgement& judgement : judgements) {
    judgement.confidence =
        static_cast<double>(random.below(static_cast<std::uint64_t>(levels))) / (levels - 1);
    judgement.right = random.uniform() < judgement.confidence;
  }
  return judgements;
}

TEST(ConfidenceSummary, AreaIsTheShareOfPairsInTheRightOrder) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const auto judgements = some(seed, 20 + 10 * seed, seed % 2 ? 5 : 1001);
    double won = 0, all = 0;
    for (const Judgement& right : judgements)
      for (const Judgement& wrong : judgements) {
        if (!right.right || wrong.right) continue;
        ++all;
        won += right.confidence > wrong.confidence ? 1 : right.confidence == wrong.confidence ? 0.5 : 0;
      }
    ASSERT_GT(all, 0);
    EXPECT_DOUBLE_EQ(summarise_confidence(judgements).area.value(), won / all);
  }
}

TEST(ConfidenceSummary, HasNoAreaWhenAllAreAlike) {
  EXPECT_FALSE(summarise_confidence(std::vector<Judgement>()).area);
  EXPECT_FALSE(summarise_confidence(std::vector<Judgement>{{0.2, true}, {0.9, true}}).area);
  EXPECT_FALSE(summarise_confidence(std::vector<Judgement>{{0.2, false}}).area);
  EXPECT_EQ(summarise_confidence(std::vector<Judgement>{{0.2, false}, {0.9, true}}).area, 1);
  EXPECT_EQ(summarise_confidence(std::vector<Judgement>{{0.2, true}, {0.9, false}}).area, 0);
}

TEST(ConfidenceSummary, BinsHoldEveryPoseOnce) {
  const auto judgements = some(4, 500, 41);
  const ConfidenceSummary summary = summarise_confidence(judgements);
  std::size_t poses = 0;
  double said = 0, was = 0;
  for (const ConfidenceBin& bin : summary.bins) {
    EXPECT_GE(bin.said, bin.low);
    EXPECT_LE(bin.said, bin.high);
    poses += bin.poses;
    said += bin.said * static_cast<double>(bin.poses);
    was += bin.was * static_cast<double>(bin.poses);
  }
  EXPECT_EQ(poses, 500);
  EXPECT_NEAR(said / 500, summary.said, 1e-12);
  EXPECT_NEAR(was / 500, summary.was, 1e-12);
}

TEST(ConfidenceSummary, NearIsTwentyDegreesAndATenth) {
  EXPECT_TRUE(near_truth({.rotation = 20, .translation_fraction = 0.1}));
  EXPECT_FALSE(near_truth({.rotation = 20.1, .translation_fraction = 0}));
  EXPECT_FALSE(near_truth({.rotation = 0, .translation_fraction = 0.101}));
}

}  // namespace
}  // namespace bitr
