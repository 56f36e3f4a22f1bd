#include "core/thread_pool.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace bitr {
namespace {

// Runs one parallel_for; expects every index exactly once, in pieces of at most `grain` that start at its
// multiples.
void expect_each_once(ThreadPool& pool, std::size_t count, std::size_t grain) {
  std::vector<std::atomic<int>> seen(count);
  std::atomic<int> wrong_pieces = 0;
  pool.parallel_for(count, grain, [&](std::size_t begin, std::size_t end) {
    wrong_pieces += begin >= end || end > count || end - begin > grain || begin % grain != 0;
    for (std::size_t i = begin; i < std::min(end, count); ++i) ++seen[i];
  });
  EXPECT_EQ(wrong_pieces, 0) << count << " / " << grain;
  EXPECT_TRUE(std::all_of(seen.begin(), seen.end(), [](const auto& n) { return n == 1; }))
      << count << " / " << grain;
}

TEST(ThreadPool, VisitsEveryIndexOnce) {
  for (const unsigned threads : {1u, 2u, 3u, 8u}) {
    ThreadPool pool(threads);
    EXPECT_EQ(pool.threads(), threads);
    for (const std::size_t count : {0, 1, 2, 7, 8, 9, 63, 64, 65, 1000, 4097})
      for (const std::size_t grain : {1, 2, 7, 64, 5000}) expect_each_once(pool, count, grain);
  }
}

TEST(ThreadPool, IsDoneWhenItReturns) {
  ThreadPool pool(4);
  for (int round = 0; round < 2000; ++round) {
    std::vector<int> values(40, 0);
    pool.parallel_for(values.size(), 1, [&](std::size_t begin, std::size_t) { values[begin] = round; });
    ASSERT_EQ(values, std::vector<int>(40, round));
  }
}

TEST(ThreadPool, ServesCallersInTurn) {
  ThreadPool pool(3);
  std::vector<std::thread> callers;
  for (int caller = 0; caller < 4; ++caller)
    callers.emplace_back([&pool, caller] {
      for (int round = 0; round < 200; ++round) expect_each_once(pool, 50 + caller, 1 + round % 9);
    });
  for (std::thread& caller : callers) caller.join();
}

TEST(ThreadPool, ZeroTakesTheCoresOfTheProcess) {
  const ThreadPool pool(0);
  EXPECT_GE(pool.threads(), 1u);
  EXPECT_LE(pool.threads(), std::max(1u, std::thread::hardware_concurrency()));
}

// Whoever runs the piece that throws; the pool works on afterwards.
TEST(ThreadPool, ThrowsWhatABodyThrew) {
  for (const unsigned threads : {1u, 3u}) {
    ThreadPool pool(threads);
    for (std::size_t bad = 0; bad < 30; ++bad) {
      const auto body = [&](std::size_t begin, std::size_t) {
        if (begin == bad) throw std::runtime_error("piece " + std::to_string(bad));
      };
      EXPECT_THROW(pool.parallel_for(30, 1, body), std::runtime_error);
      expect_each_once(pool, 100, 3);
    }
  }
}

TEST(ThreadPool, StartsAndStopsWithoutWork) {
  for (int i = 0; i < 50; ++i) ThreadPool(3);
}

}  // namespace
}  // namespace bitr
