// bitr batch on a Vulkan device that is lost: lose_device/ is put between the command and the driver.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <sstream>
#include <utility>

#include "run_command.hpp"

namespace bitr::test {
namespace {

using nlohmann::json;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using Words = std::vector<std::string>;

constexpr int count = 7;

struct Results {
  Finished finished;
  std::vector<json> lines;  ///< without the first, which holds the settings
  int submissions = 0;      ///< 0: the layer was not there
};

/// The pairs, and what becomes of them where nothing is lost: the same for every test.
struct Untroubled {
  const Folder clouds;
  Results whole;
  bool device = false;
};

class BatchLost : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    untroubled_ = std::make_unique<Untroubled>();
    const Finished listed = run_command({"devices", "--json"});
    ASSERT_EQ(listed.status, 0) << listed.err;
    const json found = json::parse(listed.out);
    for (const json& device : found["devices"])
      untroubled_->device = untroubled_->device || device["usable"].get<bool>();
    if (!untroubled_->device) return;
    const Finished made = run_command({"generate", "copy", "--out", untroubled_->clouds.path(), "--count",
                                       std::to_string(count), "--points", "60"});
    ASSERT_EQ(made.status, 0) << made.err;
    untroubled_->whole = run_by("2", {});
  }
  static void TearDownTestSuite() { untroubled_.reset(); }

  void SetUp() override {
    if (!untroubled_->device) GTEST_SKIP() << "no Vulkan device";
    ASSERT_EQ(whole_.finished.status, 0) << whole_.finished.err;
    ASSERT_EQ(whole_.lines.size(), count);
    if (whole_.submissions == 0) GTEST_SKIP() << "the Vulkan loader takes no layers";
    // A plan's own, and one for each of the four times that pairs go to the device.
    ASSERT_GE(whole_.submissions, 5);
  }

  Results run(Words environment, const Words& options = {}, const Folder& out = Folder()) const {
    return run_by(pairs_, std::move(environment), options, out);
  }
  static Results run_by(const std::string& pairs, Words environment, const Words& options = {},
                        const Folder& out = Folder()) {
    const std::string counted = out.path("submissions");
    environment.insert(environment.end(),
                       {"VK_LAYER_PATH=" BITR_LAYERS, "VK_INSTANCE_LAYERS=VK_LAYER_BITR_lose_device",
                        "LOSE_DEVICE_COUNT=" + counted});
    Results found;
    Words words = {"batch",
                   untroubled_->clouds.path("copy.jsonl"),
                   "--out",
                   out.path(),
                   "--complete-match",
                   "--backend",
                   "vulkan",
                   "--pairs",
                   pairs};
    words.insert(words.end(), options.begin(), options.end());
    found.finished = run_command(words, environment);
    std::istringstream text(read_text(out.path("results.jsonl")));
    for (std::string line; std::getline(text, line);) found.lines.push_back(json::parse(line));
    if (!found.lines.empty()) found.lines.erase(found.lines.begin());
    if (std::filesystem::exists(counted)) found.submissions = std::stoi(read_text(counted));
    return found;
  }

  // Every pair has its line, in order, and every line its pose.
  static void expect_whole(const Results& found, const Results& whole) {
    EXPECT_EQ(found.finished.status, 0);
    EXPECT_THAT(found.finished.err, AllOf(HasSubstr("lost"), HasSubstr("going on with a new device")));
    EXPECT_EQ(found.finished.err.find("warning"), found.finished.err.rfind("warning")) << found.finished.err;
    EXPECT_EQ(found.lines, whole.lines);
    EXPECT_GT(found.submissions, whole.submissions);
  }
  // First the plan's, then the pairs'.
  std::vector<int> chosen() const { return {1, 2, whole_.submissions / 2, whole_.submissions}; }

  static inline std::unique_ptr<Untroubled> untroubled_;
  const Results& whole_ = untroubled_->whole;
  std::string pairs_ = "2";  ///< in a submission
};

TEST_F(BatchLost, NothingIsSaidWhereNothingIsLost) {
  EXPECT_THAT(whole_.finished.err, Not(HasSubstr("lost")));
}

TEST_F(BatchLost, GoesOnAfterALossAtSubmission) {
  for (const int at : chosen()) {
    SCOPED_TRACE(at);
    expect_whole(run({"LOSE_DEVICE_AT=" + std::to_string(at)}), whole_);
  }
}

TEST_F(BatchLost, GoesOnAfterALossWhileWaiting) {
  for (const int at : chosen()) {
    SCOPED_TRACE(at);
    expect_whole(run({"LOSE_DEVICE_AT=" + std::to_string(at), "LOSE_DEVICE_WHILE_WAITING=1"}), whole_);
  }
}

TEST_F(BatchLost, GoesOnAfterALossInRefinement) {
  const Words transport = {"--refine", "ot"};
  const Results whole = run({}, transport);
  ASSERT_EQ(whole.finished.status, 0) << whole.finished.err;
  ASSERT_GT(whole.submissions, whole_.submissions);
  // Two passes of the network come before it.
  for (Words environment : {Words{}, {"LOSE_DEVICE_WHILE_WAITING=1"}}) {
    environment.push_back("LOSE_DEVICE_AT=5");
    const Results found = run(environment, transport);
    expect_whole(found, whole);
    EXPECT_THAT(found.finished.err, Not(HasSubstr("kernel: pose")));
  }
}

// Whatever the second one hits: the new device as it is tried out, or the pairs that are sent again.
TEST_F(BatchLost, GoesOnAfterTwoLosses) {
  for (const auto& [at, least] : {std::pair(1, 1), {whole_.submissions / 2, 2}})
    for (int second = at + least; second <= at + 6; second += 2) {
      SCOPED_TRACE(std::to_string(at) + ", " + std::to_string(second));
      const Results found = run({"LOSE_DEVICE_AT=" + std::to_string(at) + "," + std::to_string(second)});
      EXPECT_EQ(found.finished.status, 0) << found.finished.err;
      EXPECT_THAT(found.finished.err, AllOf(HasSubstr("going on with a new device"), Not(HasSubstr("anew"))));
      EXPECT_EQ(found.lines, whole_.lines);
    }
}

// A pair that is lost with the new device, too, is left; the others are done.
TEST_F(BatchLost, GoesOnAfterAPairThatTwoDevicesAreLostWith) {
  pairs_ = "1";
  int left = 0;
  for (int second = 4; second <= 9; ++second) {
    SCOPED_TRACE(second);
    const Results found = run({"LOSE_DEVICE_AT=3," + std::to_string(second)});
    if (found.lines == whole_.lines) continue;
    ++left;
    EXPECT_EQ(found.finished.status, 1);
    EXPECT_THAT(found.finished.err, HasSubstr("1 of 7 pairs have no usable pose"));
    ASSERT_EQ(found.lines.size(), count);
    int others = 0;
    for (int i = 0; i < count; ++i) {
      if (found.lines[i] == whole_.lines[i]) {
        ++others;
        continue;
      }
      EXPECT_EQ(found.lines[i]["status"], "unreadable");
      EXPECT_THAT(found.lines[i]["problem"].get<std::string>(), HasSubstr("lost"));
    }
    EXPECT_EQ(others, count - 1);
  }
  EXPECT_GT(left, 0);
}

TEST_F(BatchLost, LostForGoodEndsTheRunAndResumeDoesTheRest) {
  for (const auto& [at, waiting] :
       {std::pair(1, false), {whole_.submissions / 2, true}, {whole_.submissions, false}}) {
    SCOPED_TRACE(at);
    const Folder out;
    Words environment = {"LOSE_DEVICE_AT=" + std::to_string(at), "LOSE_DEVICE_AGAIN=1"};
    if (waiting) environment.push_back("LOSE_DEVICE_WHILE_WAITING=1");
    const Results found = run(environment, {}, out);
    EXPECT_EQ(found.finished.status, 1);
    const int done = static_cast<int>(found.lines.size());
    EXPECT_THAT(found.finished.err, AllOf(HasSubstr("lost"), HasSubstr("--resume"), Not(HasSubstr("anew")),
                                          Not(HasSubstr("going on with a new device")),
                                          HasSubstr(std::to_string(done) + " of 7 pairs")));
    EXPECT_EQ(std::ranges::count(found.finished.err, '\n'), 1) << found.finished.err;
    // The first submission is the plan's own, the last one is for the last pair, alone.
    EXPECT_TRUE(at > 1 || done == 0) << done;
    EXPECT_TRUE(at < whole_.submissions || done == count - 1) << done;
    // Whole lines, however many pairs are left.
    ASSERT_LE(done, count);
    EXPECT_TRUE(std::equal(found.lines.begin(), found.lines.end(), whole_.lines.begin()));
    // Every new device is tried once, whatever the number of pairs that are left.
    EXPECT_LE(found.submissions, at + 2);
    const Results rest = run({}, {"--resume"}, out);
    EXPECT_EQ(rest.finished.status, 0) << rest.finished.err;
    EXPECT_EQ(rest.lines, whole_.lines);
  }
}

}  // namespace
}  // namespace bitr::test
