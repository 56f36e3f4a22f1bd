// bitr batch: the same poses as one by one, whatever happens to other pairs and to the run.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include <bitr/io.hpp>
#include <bitr/model.hpp>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <thread>

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
  // Room for the settings and some pairs.
  const Finished full = run_limited(RLIMIT_FSIZE, 4000, batch(manifest_, out.path()));
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

TEST_F(Batch, PassesOverALineThatIsTooLong) {
  const std::string pair = "copy_000_source.ply,copy_000_reference.ply\n";
  const std::string manifest =
      clouds_.write("long.csv", "source,reference\n" + pair + std::string(17'000'000, 'a') + "\n" + pair);
  const Folder out;
  const Finished done = run_command(batch(manifest, out.path()));
  EXPECT_EQ(done.status, 1) << done.err;
  const auto found = lines(results(out));
  ASSERT_EQ(found.size(), 3);
  EXPECT_EQ(found[0]["status"], "ok");
  EXPECT_EQ(found[1]["problem"], manifest + ", line 3: is over 1048576 bytes, the limit");
  EXPECT_EQ(found[2]["transform"], found[0]["transform"]);
  const Finished headless =
      run_command(batch(clouds_.write("head.csv", std::string(17'000'000, 'a')), out.path() + "/new"));
  EXPECT_EQ(headless.status, 2);
  EXPECT_THAT(headless.err, HasSubstr("head.csv, line 1: is over 1048576 bytes"));
}

TEST_F(Batch, ReadsFieldsAsTablesQuoteThem) {
  std::filesystem::copy(clouds_.path("copy_000_source.ply"), clouds_.path("a, \"b\".ply"));
  const std::string manifest = clouds_.write("quoted.csv",
                                             "\xef\xbb\xbfname,\"source\",reference\n\n"
                                             " first pair ,\t\"a, \"\"b\"\".ply\" , copy_000_reference.ply\n"
                                             ",\"a.ply,copy_000_reference.ply\n"
                                             ",\"a.ply\"b,copy_000_reference.ply\n"
                                             "last,copy_000_source.ply,copy_000_reference.ply,more\n");
  const Folder out;
  EXPECT_EQ(run_command(batch(manifest, out.path())).status, 1);
  const auto found = lines(results(out));
  ASSERT_EQ(found.size(), 4);
  EXPECT_EQ(found[0]["name"], "first pair");
  EXPECT_EQ(found[0]["status"], "ok");
  EXPECT_THAT(found[1]["problem"].get<std::string>(), HasSubstr("line 4: a quote is not closed"));
  EXPECT_THAT(found[2]["problem"].get<std::string>(), HasSubstr("line 5: something stands between"));
  EXPECT_THAT(found[3]["problem"].get<std::string>(), HasSubstr("line 6: has 4 fields for 3 columns"));
  EXPECT_THAT(run_command(batch(clouds_.write("twice.csv", "source,reference,source\n"), out.path())).err,
              HasSubstr("names twice \"source\""));
}

TEST_F(Batch, RefusesAManifestThatCanBeReadOnce) {
  ASSERT_EQ(mkfifo(clouds_.path("pipe.csv").c_str(), 0600), 0);
  const Folder out;
  const Finished refused = run_command(batch(clouds_.path("pipe.csv"), out.path()));
  EXPECT_EQ(refused.status, 2);
  EXPECT_THAT(refused.err, HasSubstr("pipe.csv: is no regular file"));
}

TEST_F(Batch, GoesOnWithTheSameWeightsAlone) {
  const std::string net = clouds_.path("net.safetensors");
  const auto weights = [&](std::uint64_t seed) {
    const auto model = untrained_model({}, seed);
    ASSERT_TRUE(model) << model.error().message;
    ASSERT_TRUE(io::write_file(net, serialize(*model)));
  };
  const auto with_net = [&](const std::string& out, std::vector<std::string> more) {
    more.insert(more.begin(), {"batch", manifest_, "--out", out, "--model", net, "--backend", "cpu"});
    return run_command(more);
  };
  const Folder out;
  weights(1);
  ASSERT_LT(with_net(out.path(), {}).status, 2);
  const std::string before = read_text(results(out));
  weights(2);
  const Finished mixed = with_net(out.path(), {"--resume"});
  EXPECT_EQ(mixed.status, 2);
  EXPECT_THAT(mixed.err, HasSubstr("with another model"));
  EXPECT_EQ(read_text(results(out)), before);
  weights(1);
  EXPECT_LT(with_net(out.path(), {"--resume"}).status, 2);
}

TEST_F(Batch, NoticesThatItsFolderIsGone) {
  // A pair that is a pipe holds the run up until the folder is gone.
  ASSERT_EQ(mkfifo(clouds_.path("pipe.ply").c_str(), 0600), 0);
  const std::string manifest = clouds_.write(
      "held.csv",
      "source,reference\ncopy_000_source.ply,copy_000_reference.ply\npipe.ply,copy_000_reference.ply\n");
  const Folder folder;
  const std::string out = folder.path("out");
  std::thread meddler([&] {
    std::ofstream pipe(clouds_.path("pipe.ply"), std::ios::binary);  // waits for the reader
    while (!std::filesystem::exists(out + "/results.jsonl"))
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    std::filesystem::remove_all(out);
    pipe << read_text(clouds_.path("copy_000_source.ply"));
  });
  const Finished lost = run_command(batch(manifest, out));
  meddler.join();
  EXPECT_EQ(lost.status, 2);
  EXPECT_THAT(lost.err, HasSubstr("results.jsonl: cannot write: No such file or directory"));
}

TEST_F(Batch, WritesOverNoneOfItsClouds) {
  const Folder out;
  const std::string own = out.path("pair_000000.ply"), linked = out.path("pair_000001.ply");
  std::filesystem::copy(clouds_.path("copy_000_source.ply"), own);
  std::filesystem::create_symlink(clouds_.path("copy_001_source.ply"), linked);
  const std::string reference = clouds_.path("copy_000_reference.ply"),
                    behind = clouds_.path("copy_001_source.ply");
  for (const auto& [cloud, message] : {std::pair(own, own), {behind, behind}}) {
    const std::string before = read_text(cloud);
    const std::string manifest = clouds_.write("own.csv", "source,reference\n" + reference + "," + reference +
                                                              "\n" + cloud + "," + reference + "\n");
    const Finished refused = run_command(batch(manifest, out.path(), {"--assembled"}));
    EXPECT_EQ(refused.status, 2);
    EXPECT_THAT(refused.err, HasSubstr("--assembled: would replace " + message));
    EXPECT_EQ(read_text(cloud), before);
    EXPECT_FALSE(std::filesystem::exists(results(out)));
  }
}

TEST_F(Batch, LeavesAForeignFileAlone) {
  for (const std::string text : {"{\"a\":1}", "{\"a\":1}\n", "my notes", "[]\n{}\n"}) {
    const Folder out;
    out.write("results.jsonl", text);
    const Finished refused = run_command(batch(manifest_, out.path(), {"--resume"}));
    EXPECT_EQ(refused.status, 2) << text;
    EXPECT_THAT(refused.err, HasSubstr("results.jsonl: does not begin as the results of a batch do")) << text;
    EXPECT_EQ(read_text(results(out)), text);
  }
}

TEST_F(Batch, TrustsNoLineThatItDidNotWrite) {
  const Folder whole;
  ASSERT_EQ(run_command(batch(manifest_, whole.path())).status, 0);
  const std::string all = read_text(results(whole));
  const std::size_t head = all.find('\n') + 1, second = all.find('\n', head) + 1;
  const std::string settings = all.substr(0, head), rest = all.substr(head),
                    first = all.substr(head, second - head);
  const auto changed = [&](const char* key, const json& value) {
    json line = json::parse(first);
    line[key] = value;
    return line.dump() + "\n";
  };
  for (const auto& [text, message] : std::vector<std::pair<std::string, std::string>>{
           {"{\"pair\":39,\"status\":\"ok\"}\n" + rest,
            "line 2, where that of pair 0 belongs, is of pair 39"},
           {first + rest, "line 3, where that of pair 1 belongs, is of pair 0"},
           {changed("errors", 5), "has \"errors\" without \"rotation_degrees\""},
           {changed("errors", {{"rotation_degrees", "x"}}), "has \"errors\" without"},
           {changed("confidence", {{"value", nullptr}}), "has a \"confidence\" that is no number"},
           {changed("status", "fine"), "has a status that there is not"},
           {changed("transform", 1), "has no \"transform\""},
           {changed("name", 7), "has no \"name\""},
           {"{\"pair\":\"0\"}\n", "has no number of a pair"},
           {"not JSON\n", "is no JSON object"}}) {
    const Folder out;
    out.write("results.jsonl", settings + text);
    const Finished refused = run_command(batch(manifest_, out.path(), {"--resume"}));
    EXPECT_EQ(refused.status, 2) << message;
    EXPECT_THAT(refused.err, AllOf(HasSubstr("results.jsonl: line "), HasSubstr(message)));
    EXPECT_EQ(read_text(results(out)), settings + text);
  }
}

TEST_F(Batch, FollowsNoLinkToNothing) {
  const Folder out, elsewhere;
  std::filesystem::create_symlink(elsewhere.path("made"), results(out));
  for (const std::vector<std::string>& more : {std::vector<std::string>{}, {"--resume"}}) {
    const Finished refused = run_command(batch(manifest_, out.path(), more));
    EXPECT_EQ(refused.status, 2);
    EXPECT_THAT(refused.err, HasSubstr("results.jsonl: is a symbolic link to nothing"));
  }
  EXPECT_TRUE(elsewhere.names().empty());
}

TEST_F(Batch, SaysWhyItsFolderCannotBeMade) {
  const Folder folder;
  std::filesystem::create_symlink("nothing", folder.path("link"));
  const Finished refused = run_command(batch(manifest_, folder.path("link")));
  EXPECT_EQ(refused.status, 2);
  EXPECT_THAT(refused.err, HasSubstr("link: cannot be made: "));
  EXPECT_THAT(refused.err, testing::Not(HasSubstr("Success")));
}

TEST_F(Batch, RunsOutOfMemoryWithAnError) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "sanitizers need more room than any limit here";
#endif
  const Finished large =
      run_command({"generate", "copy", "--out", clouds_.path("large"), "--count", "1", "--points", "200000"});
  ASSERT_EQ(large.status, 0) << large.err;
  int short_of_it = 0;
  for (const std::string& manifest : {manifest_, clouds_.path("large/copy.jsonl")}) {
    for (std::uint64_t mebibytes = 24; mebibytes < 200; mebibytes += mebibytes / 8) {
      const Folder out;
      const Finished done = run_limited(RLIMIT_AS, mebibytes << 20, batch(manifest, out.path()));
      // 127: there was no room for the program itself.
      EXPECT_LE(done.status, 127) << mebibytes << " MiB: " << done.err;
      if (done.status == 0 || done.status == 127) continue;
      std::string said = done.err;
      if (std::filesystem::exists(results(out))) said += read_text(results(out));
      EXPECT_THAT(said, HasSubstr("memory")) << mebibytes << " MiB";
      ++short_of_it;
    }
  }
  EXPECT_GT(short_of_it, 0);
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
