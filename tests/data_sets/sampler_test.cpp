#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <bitr/data.hpp>

#include <thread>

#include "folder.hpp"

namespace bitr {
namespace {

using testing::HasSubstr;

DataSet mixture(std::uint64_t seed = 3) {
  DataOptions options;
  options.parts = {{.kind = "aircraft", .shapes = 7}, {.kind = "vessels", .shapes = 6}};
  options.points_low = 30;
  options.points_high = 60;
  options.noise = 0.01;
  options.seed = seed;
  return DataSet::open(options).value();
}

std::vector<std::vector<Vec3d>> sources(Sampler& sampler, std::size_t count) {
  std::vector<std::vector<Vec3d>> list;
  for (std::size_t i = 0; i < count; ++i) list.push_back(sampler.next().value().source.positions);
  return list;
}

TEST(Sampler, SequenceIsTheSameForAnyNumberOfThreads) {
  const DataSet data = mixture();
  std::vector<std::vector<Vec3d>> expected;
  for (std::uint64_t epoch = 0; epoch < 4; ++epoch)
    for (std::size_t i = 0; i < data.samples(); ++i)
      expected.push_back(data.sample(epoch, i).value().source.positions);
  for (const unsigned threads : {0u, 1u, 2u, 5u})
    for (const std::size_t ahead : {1u, 3u, 100u}) {
      // A data set of its own, so that no shape is there already.
      Sampler sampler = Sampler::start(mixture(), {.threads = threads, .ahead = ahead}).value();
      EXPECT_EQ(sources(sampler, expected.size()), expected) << threads << " threads, " << ahead << " ahead";
    }
}

TEST(Sampler, GoesOnWhereItWas) {
  Sampler first = Sampler::start(mixture(), {.threads = 2, .ahead = 8}).value();
  (void)sources(first, 17);
  const DataPosition position = first.position();
  EXPECT_EQ(position.epoch, 1u);
  EXPECT_EQ(position.index, 4u);
  const auto expected = sources(first, 20);
  Sampler second = Sampler::start(mixture(), {.threads = 1, .start = position}).value();
  EXPECT_EQ(sources(second, 20), expected);
  EXPECT_EQ(second.position().epoch, 2u);
  EXPECT_EQ(second.position().index, 11u);
}

TEST(Sampler, MayBeLeftAtAnyTime) {
  for (int given = 0; given < 20; ++given) {
    Sampler sampler = Sampler::start(mixture(), {.threads = 3, .ahead = 5}).value();
    (void)sources(sampler, given % 4);
    Sampler moved = std::move(sampler);
    sampler = Sampler::start(mixture(), {.threads = 1}).value();
    EXPECT_TRUE(moved.next().has_value());
  }
}

TEST(Sampler, ServesSeveralThreadsWithoutLosingASample) {
  Sampler sampler = Sampler::start(mixture(), {.threads = 2, .ahead = 4}).value();
  std::vector<std::size_t> taken(3);
  std::vector<std::thread> threads;
  for (std::size_t& count : taken)
    threads.emplace_back([&] {
      for (int i = 0; i < 30; ++i) count += sampler.next().has_value();
    });
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(taken, (std::vector<std::size_t>{30, 30, 30}));
  EXPECT_EQ(sampler.position().epoch * 13 + sampler.position().index, 90u);
}

TEST(Sampler, GivesTheErrorInTheSamplesPlace) {
  const test::ShapeFolder folder;
  folder.write("broken.off", "OFF\n1 2\n");
  DataOptions options;
  options.parts = {{.kind = "aircraft", .shapes = 3}, {.folder = folder.path(), .weight = 3}};
  options.points_low = options.points_high = 20;
  options.samples = 8;
  const DataSet data = DataSet::open(options).value();
  Sampler sampler = Sampler::start(data, {.threads = 2}).value();
  int errors = 0;
  for (int i = 0; i < 8; ++i) errors += !sampler.next().has_value();
  EXPECT_EQ(errors, 6);
  EXPECT_EQ(data.skipped().size(), 1u);
}

TEST(Sampler, RefusesAPositionThatIsNotItsOwn) {
  const DataSet data = mixture();
  const auto message = [&](const SamplerOptions& options) {
    const auto sampler = Sampler::start(data, options);
    EXPECT_FALSE(sampler.has_value());
    return sampler ? std::string() : sampler.error().message;
  };
  EXPECT_THAT(message({.ahead = 0}), HasSubstr("0 samples ahead"));
  EXPECT_THAT(message({.start = {.index = 13}}), HasSubstr("sample 13 of an epoch of 13"));
  EXPECT_THAT(message({.start = {.fingerprint = mixture(4).fingerprint()}}), HasSubstr("another data set"));
}

}  // namespace
}  // namespace bitr
