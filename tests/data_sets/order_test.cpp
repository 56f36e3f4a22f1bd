#include "data_sets/order.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

namespace bitr::data {
namespace {

TEST(Shuffled, IsAPermutationThatTheKeyDecides) {
  for (const std::uint64_t count : {1, 2, 3, 10, 97, 1000})
    for (const std::uint64_t key : {0, 1, 2}) {
      std::vector<bool> seen(count);
      for (std::uint64_t i = 0; i < count; ++i) {
        const std::uint64_t at = shuffled(i, count, key);
        ASSERT_LT(at, count);
        EXPECT_FALSE(seen[at]);
        seen[at] = true;
      }
    }
  std::size_t same = 0;
  for (std::uint64_t i = 0; i < 1000; ++i) same += shuffled(i, 1000, 1) == shuffled(i, 1000, 2);
  EXPECT_LT(same, 10u);
}

TEST(Shuffled, EveryOrderIsAsLikely) {
  double counts[24] = {};
  const int keys = 24'000;
  for (int key = 0; key < keys; ++key) {
    int order[4], rank = 0;
    for (int i = 0; i < 4; ++i) order[i] = static_cast<int>(shuffled(i, 4, key));
    for (int i = 0; i < 4; ++i) {
      int smaller = 0;
      for (int j = i + 1; j < 4; ++j) smaller += order[j] < order[i];
      rank = rank * (4 - i) + smaller;
    }
    counts[rank] += 1;
  }
  double chi_square = 0;
  for (const double count : counts)
    chi_square += (count - keys / 24.0) * (count - keys / 24.0) / (keys / 24.0);
  EXPECT_LT(chi_square, 23 + 5 * std::sqrt(46.0));
}

TEST(Hash, OfNamesIsSpreadEvenly) {
  double bins[20] = {};
  for (int i = 0; i < 20'000; ++i)
    bins[static_cast<int>(20 * fraction(hash("aircraft/" + std::to_string(i))))] += 1;
  for (const double bin : bins) EXPECT_NEAR(bin, 1000, 160);
}

}  // namespace
}  // namespace bitr::data
