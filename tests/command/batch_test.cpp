// bitr batch: the same poses as one by one, whatever happens to other pairs and to the run.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "run_command.hpp"

namespace bitr::test {
namespace {

using nlohmann::json;
using testing::AllOf;
using testing::HasSubstr;

constexpr int count = 7;

/// Moved copies, and `copy.jsonl` that lists them.
void make_pairs(const Folder& folder) {
  const Finished made = run_command(
      {"generate", "copy", "--out", folder.path(), "--count", std::to_string(count), "--points", "60"});
  ASSERT_EQ(made.status, 0) << made.err;
}

std::vector<std::string> batch(const std::string& manifest, const std::string& out,
                               const std::vector<std::string>& more = {}) {
  std::vector<std::string> words = {"batch",     manifest, "--out",   out, "--complete-match",
                                    "--backend", "cpu",    "--pairs", "3", "--threads",
                                    "1"};
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

/// Without the first, which holds the settings.
std::vector<json> lines(const std::string& file) {
  std::istringstream text(read_text(file));
  std::vector<json> all;
  for (std::string line; std::getline(text, line);) all.push_back(json::parse(line));
  if (!all.empty()) all.erase(all.begin());
  return all;
}

class Batch : public testing::Test {
 protected:
  void SetUp() override {
    make_pairs(clouds_);
    manifest_ = clouds_.path("copy.jsonl");
  }
  std::string results(const Folder& folder) const { return folder.path("results.jsonl"); }

  const Folder clouds_;
  std::string manifest_;
};

TEST_F(Batch, FindsThePosesThatAssembleFinds) {
  const Folder out;
  const Finished done = run_command(batch(manifest_, out.path(), {"--assembled"}));
  ASSERT_EQ(done.status, 0) << done.err;
  EXPECT_THAT(done.out, HasSubstr("7: 7 ok"));
  const auto found = lines(results(out));
  ASSERT_EQ(found.size(), count);
  for (int i = 0; i < count; ++i) {
    const std::string name = clouds_.path("copy_00" + std::to_string(i)), one = out.path("one.json");
    EXPECT_EQ(found[i]["pair"], i);
    EXPECT_EQ(found[i]["name"], "copy_00" + std::to_string(i));
    EXPECT_LT(found[i]["errors"]["rotation_degrees"], 0.05);
    const Finished alone =
        run_command({"assemble", name + "_source.ply", name + "_reference.ply", "--complete-match",
                     "--backend", "cpu", "--json", one, "-o", out.path("one.ply")});
    ASSERT_EQ(alone.status, 0) << alone.err;
    EXPECT_EQ(found[i]["transform"], read_json(one)["transform"]);
    EXPECT_EQ(read_text(out.path("pair_00000" + std::to_string(i) + ".ply")), read_text(out.path("one.ply")));
  }
}

TEST_F(Batch, SearchesNeighboursAsAskedToTheSameBytes) {
  const Folder plain, tree;
  ASSERT_EQ(run_command(batch(manifest_, plain.path())).status, 0);
  ASSERT_EQ(run_command(batch(manifest_, tree.path(), {"--neighbors", "tree"})).status, 0);
  EXPECT_EQ(read_text(results(tree)), read_text(results(plain)));
  // So that a run may go on another way.
  const Finished again =
      run_command(batch(manifest_, tree.path(), {"--resume", "--neighbors", "brute-force"}));
  EXPECT_EQ(again.status, 0) << again.err;
}

TEST_F(Batch, ReadsTablesAndPosesInPlace) {
  std::string table = "source, reference, truth\r\n", text;
  for (int i = 0; i < count; ++i) {
    const std::string name = "copy_00" + std::to_string(i);
    const json truth = read_json(clouds_.path(name + "_truth.json"));
    table += "\"" + name + "_source.ply\", " + name + "_reference.ply ," + name + "_truth.json\r\n";
    text += json{{"source", name + "_source.ply"},
                 {"reference", name + "_reference.ply"},
                 {"T_reference_source", truth["T_reference_source"]}}
                .dump() +
            "\n\n";
  }
  const Folder a, b;
  ASSERT_EQ(run_command(batch(clouds_.write("pairs.csv", table), a.path())).status, 0);
  ASSERT_EQ(run_command(batch(clouds_.write("pairs.jsonl", text), b.path())).status, 0);
  EXPECT_EQ(lines(results(a)).size(), count);
  EXPECT_EQ(lines(results(a)), lines(results(b)));
  EXPECT_EQ(lines(results(a))[1]["name"], "pair 1");
}

TEST_F(Batch, OneBadPairStopsNothing) {
  clouds_.write("broken.ply", "ply\nformat ascii 1.0\nelement vertex -3\n");
  clouds_.write("few.xyz", "0 0 0\n1 0 0\n0 1 0\n");
  clouds_.write("skewed.json", R"({"T_reference_source": [[2,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]})");
  const std::string manifest =
      clouds_.write("bad.csv",
                    "reference,source,truth,note\n"
                    "copy_000_reference.ply,copy_000_source.ply,,fine\n"
                    "copy_001_reference.ply,\"missing, really.ply\",,\n"
                    "copy_001_reference.ply,broken.ply,,\n"
                    "few.xyz,copy_001_source.ply,,\n"
                    "copy_002_reference.ply,copy_002_source.ply,skewed.json,\n"
                    "copy_002_reference.ply\n"
                    "copy_002_reference.ply,,,\n"
                    "\n"
                    "copy_003_reference.ply,copy_003_source.ply,copy_003_truth.json,\n");
  const Folder out, fine;
  const Finished done = run_command(batch(manifest, out.path()));
  EXPECT_EQ(done.status, 1);
  EXPECT_THAT(done.err, HasSubstr("6 of 8 pairs have no usable pose"));
  const auto found = lines(results(out));
  ASSERT_EQ(found.size(), 8);
  const std::vector<std::string> problems = {"missing, really.ply", "broken.ply",      "few.xyz",
                                             "skewed.json",         "bad.csv, line 7", "bad.csv, line 8"};
  EXPECT_EQ(found[0]["status"], "ok");
  for (int i = 0; i < 6; ++i) {
    EXPECT_EQ(found[i + 1]["status"], "unreadable");
    // Too few points are found out by the network, which does not know the file.
    if (i == 2) continue;
    EXPECT_THAT(found[i + 1]["problem"].get<std::string>(), HasSubstr(problems[i]));
  }
  EXPECT_THAT(found[3]["problem"].get<std::string>(), HasSubstr("3 points"));
  EXPECT_EQ(found[7]["status"], "ok");

  ASSERT_EQ(run_command(batch(manifest_, fine.path())).status, 0);
  EXPECT_EQ(found[0]["transform"], lines(results(fine))[0]["transform"]);
  EXPECT_EQ(found[7]["transform"], lines(results(fine))[3]["transform"]);
}

TEST_F(Batch, GoesOnWhereItWasCutOff) {
  const Folder whole;
  ASSERT_EQ(run_command(batch(manifest_, whole.path())).status, 0);
  const std::string all = read_text(results(whole));
  for (const std::size_t kept : {std::size_t{0}, std::size_t{20}, all.size() / 3,
                                 all.find('\n', all.size() / 2), all.size() - 1, all.size()}) {
    const Folder out;
    out.write("results.jsonl", all.substr(0, kept));
    const Finished done = run_command(batch(manifest_, out.path(), {"--resume"}));
    ASSERT_EQ(done.status, 0) << done.err;
    EXPECT_EQ(read_text(results(out)), all) << kept;
  }
}

TEST_F(Batch, KilledAgainAndAgain) {
  const Folder whole, killed;
  ASSERT_EQ(run_command(batch(manifest_, whole.path())).status, 0);
  int interrupted = 0;
  for (int attempt = 0; attempt < 6; ++attempt)
    interrupted += run_and_signal(batch(manifest_, killed.path(), {"--resume"}),
                                  std::chrono::milliseconds(20 + 40 * attempt), SIGKILL) == 128 + SIGKILL;
  EXPECT_GT(interrupted, 0);
  ASSERT_EQ(run_command(batch(manifest_, killed.path(), {"--resume"})).status, 0);
  EXPECT_EQ(read_text(results(killed)), read_text(results(whole)));
}

TEST_F(Batch, ShardsMakeUpTheWhole) {
  const Folder whole, shards;
  ASSERT_EQ(run_command(batch(manifest_, whole.path())).status, 0);
  std::vector<json> together(count);
  for (const char* shard : {"1", "2", "3"}) {
    const std::string of = shard;
    ASSERT_EQ(run_command(batch(manifest_, shards.path(), {"--shard", of + "/3"})).status, 0);
    for (const json& line : lines(shards.path("results-" + of + "-of-3.jsonl"))) {
      EXPECT_TRUE(together.at(line["pair"]).is_null());
      together[line["pair"]] = line;
    }
  }
  EXPECT_EQ(together, lines(results(whole)));
}

TEST_F(Batch, KeepsWhatIsThere) {
  const Folder out;
  ASSERT_EQ(run_command(batch(manifest_, out.path())).status, 0);
  const std::string before = read_text(results(out));
  const Finished again = run_command(batch(manifest_, out.path()));
  EXPECT_EQ(again.status, 2);
  EXPECT_THAT(again.err, HasSubstr("--resume"));
  const Finished other = run_command(batch(manifest_, out.path(), {"--resume", "--points", "50"}));
  EXPECT_EQ(other.status, 2);
  EXPECT_THAT(other.err, HasSubstr("other options"));
  EXPECT_EQ(read_text(results(out)), before);
}

TEST_F(Batch, FullDiskLeavesWholeLines) {
  const Folder out;
  rlimit old{};
  getrlimit(RLIMIT_FSIZE, &old);
  // Room for the settings and some pairs.
  const rlimit tight{4000, old.rlim_max};
  setrlimit(RLIMIT_FSIZE, &tight);
  signal(SIGXFSZ, SIG_IGN);
  const Finished full = run_command(batch(manifest_, out.path()));
  setrlimit(RLIMIT_FSIZE, &old);
  signal(SIGXFSZ, SIG_DFL);
  EXPECT_EQ(full.status, 2);
  EXPECT_THAT(full.err, HasSubstr("results.jsonl: cannot write"));
  const std::string left = read_text(results(out));
  EXPECT_TRUE(left.empty() || left.back() == '\n');
  ASSERT_EQ(run_command(batch(manifest_, out.path(), {"--resume"})).status, 0);
  EXPECT_EQ(lines(results(out)).size(), count);
}

TEST_F(Batch, RefusesWithoutWriting) {
  const Folder folder;
  const std::string empty = folder.write("empty.csv", ""),
                    nameless = folder.write("nameless.csv", "a,b\n1,2\n");
  const std::string out = folder.path("out");
  for (const auto& [arguments, message] : std::vector<std::pair<std::vector<std::string>, std::string>>{
           {batch(folder.path("missing.csv"), out), "missing.csv"},
           {batch(empty, out), "empty.csv"},
           {batch(nameless, out), "names no column \"source\""},
           {batch(manifest_, out, {"--shard", "4/3"}), "4/3"},
           {batch(manifest_, out, {"--shard", "1"}), "I/N"},
           {batch(manifest_, out, {"--model", "missing.safetensors"}), "missing.safetensors"},
           {batch(manifest_, folder.write("file", "") + "/out"), "file/out"}}) {
    const Finished refused = run_command(arguments);
    EXPECT_EQ(refused.status, 2) << message;
    EXPECT_THAT(refused.err, HasSubstr(message));
    EXPECT_FALSE(std::filesystem::exists(out)) << message;
  }
}

TEST(BatchOfAircraft, RefinesAndJudgesAsAssembleDoes) {
  const Folder clouds, out;
  ASSERT_EQ(
      run_command({"generate", "aircraft", "--out", clouds.path(), "--count", "3", "--points", "400"}).status,
      0);
  const Finished done =
      run_command({"batch", clouds.path("aircraft.jsonl"), "--out", out.path(), "--backend", "cpu", "--pairs",
                   "2", "--refine", "icp", "--strict", "--least-confidence", "0.999999"});
  // No pose is that sure.
  EXPECT_EQ(done.status, 1);
  EXPECT_THAT(done.out, AllOf(HasSubstr("refused     3"), HasSubstr("confidence  median")));
  const auto found = lines(out.path("results.jsonl"));
  ASSERT_EQ(found.size(), 3);
  for (int i = 0; i < 3; ++i) {
    const std::string name = clouds.path("aircraft_00" + std::to_string(i)), one = out.path("one.json");
    ASSERT_EQ(run_command({"assemble", name + "_source.ply", name + "_reference.ply", "--backend", "cpu",
                           "--refine", "--json", one})
                  .status,
              0);
    const json alone = read_json(one);
    EXPECT_EQ(found[i]["transform"], alone["transform"]);
    EXPECT_EQ(found[i]["confidence"], alone["confidence"]);
    EXPECT_EQ(found[i]["refinement"], alone["refinement"]);
    EXPECT_THAT(found[i]["refused"].get<std::string>(), HasSubstr("is below"));
  }
}

}  // namespace
}  // namespace bitr::test
