// Outputs of a command appear together or not at all, and never where something else is lost by it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include <filesystem>

#include "run_command.hpp"
#include "support/paths.hpp"

namespace bitr::test {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::AnyOf;
using testing::HasSubstr;

class Outputs : public testing::Test {
 protected:
  std::vector<std::string> assemble(const std::vector<std::string>& more) const {
    std::vector<std::string> words = {"assemble",         pair.source, pair.reference,
                                      "--complete-match", "--backend", "cpu"};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
  std::vector<std::string> refine(const std::vector<std::string>& more) const {
    std::vector<std::string> words = {"refine", pair.source, pair.reference, "--backend", "cpu"};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }

  const Folder clouds, out;
  const PairFiles pair = generate_files(clouds, "copy", "500");
};

TEST_F(Outputs, KeepWhatWasThereWhenOneCannotBeWritten) {
  if (!fs::exists("/dev/full")) GTEST_SKIP() << "no /dev/full";
  const std::string earlier = out.write("a.ply", "an earlier one");
  for (const auto& words :
       {assemble({"-o", earlier, "--pose", out.path("p.txt"), "--json", "/dev/full"}),
        refine({"-o", earlier, "--pose-out", out.path("p.txt"), "--json", "/dev/full"})}) {
    const Finished failed = run_command(words);
    EXPECT_EQ(failed.status, 2) << words[0];
    EXPECT_THAT(failed.err, HasSubstr("/dev/full: cannot write: No space left on device"));
    EXPECT_EQ(read_text(earlier), "an earlier one") << words[0];
    EXPECT_EQ(out.names(), std::vector<std::string>{"a.ply"}) << words[0];
  }
  const std::string csv = out.write("e.csv", "an earlier one");
  const Finished failed =
      run_command({"eval", "--kind", "copy", "--methods", "identity", "--points", "50", "--samples", "2",
                   "--split", "all", "--shapes", "3", "--csv", csv, "--json", "/dev/full"});
  EXPECT_EQ(failed.status, 2);
  EXPECT_THAT(failed.err, HasSubstr("/dev/full: cannot write"));
  EXPECT_EQ(read_text(csv), "an earlier one");
}

TEST_F(Outputs, OverTheSystemsLimitOfAFileAreAnError) {
  const std::string earlier = out.write("u.ply", "an earlier one");
  const std::string model = out.path("m.safetensors");
  const Finished larger =
      run_command({"model", "convert", (source_dir() / "models/aircraft.safetensors").string(), model});
  ASSERT_EQ(larger.status, 0) << larger.err;
  const Folder fresh;
  for (const auto& words : {assemble({"--pose", fresh.path("p.txt"), "-o", earlier}),
                            refine({"--pose-out", fresh.path("p.txt"), "-o", earlier}),
                            {"generate", "copy", "--out", fresh.path(), "--points", "500"},
                            {"model", "convert", model, fresh.path("half.safetensors"), "--half"},
                            {"eval", "--kind", "copy", "--methods", "identity", "--points", "50", "--samples",
                             "100", "--split", "all", "--shapes", "3", "--csv", fresh.path("e.csv")}}) {
    const Finished failed = run_limited(RLIMIT_FSIZE, 4096, words);
    EXPECT_EQ(failed.status, 2) << words[0];
    EXPECT_THAT(failed.err, HasSubstr("cannot write: File too large")) << words[0];
    EXPECT_TRUE(fresh.names().empty()) << words[0] << ": " << testing::PrintToString(fresh.names());
  }
  EXPECT_EQ(read_text(earlier), "an earlier one");
}

TEST_F(Outputs, GoThroughNoLinkToNothing) {
  const std::string cloud = out.path("a.ply"), link = out.path("link");
  fs::create_symlink("a.ply", link);
  for (const auto& words : {assemble({"-o", cloud, "--json", link}), refine({"-o", cloud, "--json", link})}) {
    const Finished refused = run_command(words);
    EXPECT_EQ(refused.status, 2) << words[0];
    EXPECT_THAT(refused.err, HasSubstr("--json " + link + ": is a symbolic link to nothing"));
    EXPECT_FALSE(fs::exists(cloud)) << words[0];
  }
  // Once it leads somewhere it is the same file.
  out.write("a.ply", "an earlier one");
  EXPECT_THAT(run_command(assemble({"-o", cloud, "--json", link})).err, HasSubstr("is the file of"));
  EXPECT_EQ(read_text(cloud), "an earlier one");
}

TEST_F(Outputs, ClearAwayWhatAKilledCommandLeft) {
  out.write(".bitr-4194305-0.tmp", "half a cloud");
  const Finished done = run_command(assemble({"-o", out.path("a.ply")}));
  ASSERT_EQ(done.status, 0) << done.err;
  EXPECT_EQ(out.names(), std::vector<std::string>{"a.ply"});
}

TEST_F(Outputs, LeaveShapesAlone) {
  const Folder shapes;
  const auto generate = [&](const std::string& from, const std::string& to) {
    return run_command({"generate", "crops", "--shapes", from, "--out", to, "--points", "200"});
  };
  fs::copy(pair.source, shapes.path("crops_000_source.ply"));
  const std::string before = read_text(pair.source), shape = shapes.path("crops_000_source.ply");
  for (const std::string& from : {shapes.path(), shape}) {
    const Finished refused = generate(from, shapes.path());
    EXPECT_EQ(refused.status, 2);
    EXPECT_THAT(refused.err, AllOf(HasSubstr("--out " + shapes.path()),
                                   HasSubstr("crops_000_source.ply would replace a shape of --shapes")));
  }
  EXPECT_EQ(read_text(shape), before);
  EXPECT_EQ(shapes.names().size(), 1u);
  // A name of another kind is none of theirs.
  fs::rename(shape, shapes.path("mine.ply"));
  const Finished made = generate(shapes.path(), shapes.path());
  EXPECT_EQ(made.status, 0) << made.err;
}

TEST_F(Outputs, LeaveEvaluatedCloudsAlone) {
  const std::string before = read_text(pair.source);
  const auto refused = [&](const std::string& option, const std::string& where, const std::string& output) {
    const Finished finished = run_command({"eval", option, where, "--methods", "identity", "--samples", "1",
                                           "--csv", output, "--backend", "cpu"});
    EXPECT_EQ(finished.status, 2) << option;
    EXPECT_THAT(finished.err, HasSubstr("--csv " + output + ": would replace an input")) << option;
  };
  refused("--pairs", clouds.path("copy.jsonl"), pair.source);
  refused("--pairs", clouds.path("copy.jsonl"), pair.truth);
  refused("--data", clouds.path(), pair.source);
  EXPECT_EQ(read_text(pair.source), before);
}

TEST_F(Outputs, AreWholePairsWhateverStopsTheRest) {
  // The second pair's truth cannot be written.
  fs::create_directory(out.path("copy_001_truth.json"));
  const Finished failed =
      run_command({"generate", "copy", "--out", out.path(), "--points", "50", "--count", "2"});
  EXPECT_EQ(failed.status, 2);
  EXPECT_THAT(failed.err, HasSubstr("copy_001_truth.json: cannot write: Is a directory"));
  EXPECT_EQ(out.names(), (std::vector<std::string>{"copy_000_reference.ply", "copy_000_source.ply",
                                                   "copy_000_truth.json", "copy_001_truth.json"}));
}

TEST_F(Outputs, WaitForNoPipeInTheCache) {
  const Folder cache;
  const std::string home = "XDG_CACHE_HOME=" + cache.path();
  const auto words = std::vector<std::string>{"assemble",  pair.source, pair.reference, "--complete-match",
                                              "--backend", "vulkan",    "-o",           out.path("a.ply")};
  const Finished first = run_command(words, {home});
  if (first.status != 0) GTEST_SKIP() << first.err;
  if (!fs::exists(cache.path("bitr"))) GTEST_SKIP() << "the driver has nothing to keep";
  std::vector<fs::path> kept;
  for (const auto& entry : fs::directory_iterator(cache.path("bitr"))) kept.push_back(entry.path());
  ASSERT_EQ(kept.size(), 1u);
  fs::remove(kept[0]);
  ASSERT_EQ(mkfifo(kept[0].c_str(), 0600), 0);
  const Finished second = run_command(words, {home});
  EXPECT_EQ(second.status, 0) << second.err;
  EXPECT_TRUE(fs::is_fifo(kept[0]));
}

TEST_F(Outputs, SayWhatThereWasNoMemoryFor) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "sanitizers need more room than any limit here";
#endif
  struct Case {
    std::vector<std::string> words;
    std::string names;  ///< what the message is to name
    bool always;        ///< more than any limit here is needed
  };
  const std::vector<Case> cases = {
      {{"generate", "copy", "--out", out.path("new"), "--points", "10000000"}, "10000000 points", true},
      {assemble({"--as-defined", "--threads", "1"}), "copy_000_", false},
      {refine({"--threads", "1"}), "copy_000_", false},
      {{"bench", "--model-forward", "--points", "1000000", "--backend", "cpu", "--threads", "2"},
       "1000000 points",
       true},
      {{"eval", "--kind", "copy", "--methods", "complete-match", "--points", "1000000", "--samples", "2",
        "--backend", "cpu", "--threads", "1"},
       "1000000 points",
       true}};
  for (const Case& one : cases) {
    const std::string& command = one.words[0];
    int named = 0;
    for (std::uint64_t mebibytes = 20; mebibytes < 200; mebibytes += mebibytes / 2) {
      const Finished done = run_limited(RLIMIT_AS, mebibytes << 20, one.words);
      // 127: there was no room for the program itself.
      EXPECT_LE(done.status, 127) << command << ", " << mebibytes << " MiB: " << done.err;
      if (done.status == 0 || done.status == 127) continue;
      // Before the command has looked at its options there is nothing to name.
      EXPECT_THAT(done.err, AnyOf(AllOf(HasSubstr("memory"), HasSubstr(one.names)),
                                  HasSubstr("bitr " + command + ": out of memory"), "bitr: out of memory\n"))
          << command << ", " << mebibytes << " MiB";
      named += done.err.find(one.names) != std::string::npos;
    }
    if (one.always) {
      EXPECT_GT(named, 0) << command;
    }
  }
  EXPECT_FALSE(fs::exists(out.path("new/copy.jsonl")));
}

}  // namespace
}  // namespace bitr::test
