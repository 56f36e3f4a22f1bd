// The self-check finds what a driver does wrong: lists of neighbours with single faults.
#include <gmock/gmock.h>

#include <algorithm>
#include <bitr/doctor.hpp>

#include "api/neighbor_lists.hpp"
#include "property/network.hpp"
#include "support/plain_knn.hpp"

namespace bitr {
namespace {

class NeighborLists : public testing::Test {
 protected:
  static constexpr std::uint32_t points = 200, k = 8;
  // On a lattice, so that many are as far.
  NeighborLists() {
    Random random(4);
    for (std::uint32_t i = 0; i < 3 * points; ++i) positions_.push_back(std::round(random.uniform(-4, 4)));
    for (std::size_t row = 0; row < points; ++row) {
      const auto nearest = test::nearest_rows(&positions_[3 * row], positions_.data(), 0, points, row, k, 3);
      expected_.insert(expected_.end(), nearest.begin(), nearest.end());
    }
  }
  std::size_t wrong(const std::vector<std::uint32_t>& found) const {
    return count_wrong_neighbors({positions_, positions_, 3, k}, found, expected_);
  }
  double distance(std::size_t query, std::uint32_t row) const {
    return test::squared_distance(&positions_[3 * query], &positions_[std::size_t{3} * row], 3);
  }

  std::vector<double> positions_;
  std::vector<std::uint32_t> expected_;
};

TEST_F(NeighborLists, OfTheCpuAreRight) { EXPECT_EQ(wrong(expected_), 0u); }

TEST_F(NeighborLists, OneFartherNeighborIsFound) {
  for (const std::size_t at :
       {std::size_t{0}, std::size_t{k - 1}, expected_.size() / 2 + 3, expected_.size() - 1}) {
    auto found = expected_;
    const std::size_t query = at / k;
    std::uint32_t farther = 0;
    while (distance(query, farther) <= distance(query, expected_[at])) ++farther;
    found[at] = farther;
    EXPECT_EQ(wrong(found), 1u) << at;
  }
}

TEST_F(NeighborLists, ExactTiesAreRight) {
  auto found = expected_;
  std::size_t exchanged = 0;
  for (std::size_t i = 0; i + 1 < found.size(); ++i)
    if (i / k == (i + 1) / k && distance(i / k, found[i]) == distance(i / k, found[i + 1])) {
      std::swap(found[i], found[i + 1]);
      ++exchanged, ++i;
    }
  ASSERT_GT(exchanged, points);
  EXPECT_EQ(wrong(found), 0u);
}

TEST_F(NeighborLists, OneNeighborTwiceIsFoundAmongTies) {
  std::size_t tried = 0;
  for (std::size_t i = 0; i + 1 < expected_.size(); ++i)
    if (i / k == (i + 1) / k && distance(i / k, expected_[i]) == distance(i / k, expected_[i + 1])) {
      auto found = expected_;
      found[i + 1] = found[i];
      EXPECT_EQ(wrong(found), 1u) << i;
      ++tried;
    }
  EXPECT_GT(tried, points);
}

TEST_F(NeighborLists, RowsBeyondTheCloudAreFound) {
  auto found = expected_;
  found[5] = points;
  found[70] = 0xffffffff;
  EXPECT_EQ(wrong(found), 2u);
}

// What lavapipe did with subgroups of four: candidates of later batches are lost.
TEST_F(NeighborLists, ListsOfTheFirstCandidatesAloneAreFound) {
  std::vector<std::uint32_t> found;
  for (std::size_t row = 0; row < points; ++row) {
    const auto nearest =
        test::nearest_rows(&positions_[3 * row], positions_.data(), 0, points / 2, row, k, 3);
    found.insert(found.end(), nearest.begin(), nearest.end());
  }
  EXPECT_GT(wrong(found), found.size() / 4);
}

TEST(Doctor, PassesOnTheDevice) {
  BITR_NEEDS(Backend::vulkan);
  const auto checks = run_doctor(test::device_on(Backend::vulkan));
  ASSERT_TRUE(checks) << checks.error().message;
  std::size_t neighbors = 0, refinement = 0;
  for (const Check& check : *checks) {
    EXPECT_TRUE(check.passed()) << check.name << ": " << check.measured << ", allowed " << check.allowed
                                << check.problem;
    neighbors += check.name.starts_with("neighbours of ");
    refinement += check.name.starts_with("refinement by ");
  }
  EXPECT_EQ(neighbors, 3u);
  EXPECT_EQ(refinement, 4u);
}

}  // namespace
}  // namespace bitr
