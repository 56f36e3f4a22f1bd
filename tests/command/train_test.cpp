// bitr train, with a network and clouds so small that a step takes milliseconds.
#include <gmock/gmock.h>

#include <bitr/train.hpp>
#include <chrono>
#include <csignal>

#include "io/safetensors.hpp"
#include "run_command.hpp"

namespace bitr::test {
namespace {

using std::chrono::milliseconds;
using testing::HasSubstr;

const std::string small = R"({
  // every switch of the model that costs time is off
  "model": {"feature_num_layers": 1, "num_layers": 0, "k_neighbor": 8, "key_mean_num": 8, "num_key_points": 8,
            "re_convert_k": 4, "return_normals": false, "neighbor_dilation": 1},
  "data": {"parts": [{"kind": "copy", "shapes": 40}], "points": [40, 60]},
  "validation": {"every": 10, "samples": 4},
  "batch": 2, "log_every": 5, "steps": 20
})";

std::vector<std::string> training(const std::string& config, const std::string& out,
                                  const std::vector<std::string>& more = {}) {
  std::vector<std::string> words = {"train", config, "--out", out, "--backend", "cpu", "--threads", "1"};
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

std::map<std::string, Tensor> tensors(const std::string& path) {
  const std::string text = read_text(path);
  const auto map = io::parse_safetensors(std::as_bytes(std::span(text)), path);
  EXPECT_TRUE(map) << map.error().message;
  return map ? map->tensors : std::map<std::string, Tensor>();
}

void expect_same_tensors(const std::string& a, const std::string& b) {
  const auto one = tensors(a), two = tensors(b);
  ASSERT_EQ(one.size(), two.size());
  for (const auto& [name, tensor] : one) EXPECT_EQ(tensor.bytes, two.at(name).bytes) << name;
}

TEST(Train, ExplainsItselfWithAnExample) {
  const Finished help = run_command({"train", "--help"});
  EXPECT_EQ(help.status, 0);
  for (const char* text : {"Usage:", "Example", "--resume"}) EXPECT_THAT(help.out, HasSubstr(text));
}

TEST(Train, PrintsAConfigurationThatGivesItself) {
  const Folder folder;
  const Finished first =
      run_command({"train", "--kind", "aircraft", "--steps", "7", "--set", "optimizer.lr=1e-3", "--set",
                   "data.parts.0.share=[0.5,0.6]", "--print-config"});
  ASSERT_EQ(first.status, 0) << first.err;
  const auto json = nlohmann::json::parse(first.out);
  EXPECT_EQ(json["steps"], 7);
  EXPECT_EQ(json["optimizer"]["lr"], 1e-3);
  EXPECT_EQ(json["data"]["parts"][0]["kind"], "aircraft");
  EXPECT_EQ(json["data"]["parts"][0]["share"][1], 0.6);
  const Finished again = run_command({"train", folder.write("config.json", first.out), "--print-config"});
  EXPECT_EQ(again.out, first.out) << again.err;
}

TEST(Train, MakesAModelThatOtherCommandsTake) {
  const Folder folder;
  const std::string out = folder.path("m.safetensors");
  const Finished made = run_command(training(folder.write("small.json", small), out));
  ASSERT_EQ(made.status, 0) << made.err;
  EXPECT_THAT(made.out, HasSubstr("step 10 of 20; copy: "));
  EXPECT_THAT(made.out, HasSubstr("finished at step 20"));
  EXPECT_EQ(made.err, "");
  EXPECT_THAT(folder.names(), testing::ElementsAre("m.checkpoint", "m.curves.svg", "m.last.safetensors",
                                                   "m.metrics.jsonl", "m.safetensors", "small.json"));
  const PairFiles pair = generate_files(folder, "copy", "60");
  const Finished used = run_command({"assemble", pair.source, pair.reference, "--model", out, "--backend",
                                     "cpu", "--json", folder.path("pose.json")});
  EXPECT_EQ(used.status, 0) << used.err;
  const Finished info = run_command({"model", "info", out, "--json", "-"});
  const auto metadata = nlohmann::json::parse(info.out)["metadata"];
  EXPECT_EQ(metadata["bitr.points_high"], "60");
  EXPECT_EQ(nlohmann::json::parse(metadata["bitr.training"].get<std::string>())["steps"], 20);
}

TEST(Train, TheOfficialLossAndNormsTrainToo) {
  const Folder folder;
  const std::string config = folder.write("small.json", small);
  for (const char* mode : {"mode=scale-exact", "mode=reference"}) {
    const std::string out = folder.path(std::string(mode) + ".safetensors");
    const Finished finished =
        run_command(training(config, out, {"--set", "loss=official", "--set", mode, "--steps", "3"}));
    EXPECT_EQ(finished.status, 0) << finished.err;
    EXPECT_TRUE(load_model(out));
  }
}

TEST(Train, KilledAtAnyMomentItGoesOnFromACheckpoint) {
  const Folder folder;
  const std::string config = folder.write("small.json", small);
  const std::string straight = folder.path("straight.safetensors"),
                    killed = folder.path("killed.safetensors");
  const std::vector<std::string> often = {"--steps", "100", "--set", "checkpoint.steps=1"};
  ASSERT_EQ(run_command(training(config, straight, often)).status, 0);

  std::vector<std::string> resume = often;
  resume.push_back("--resume");
  bool begun = false;
  for (int attempt = 0; attempt < 8; ++attempt) {
    const int status =
        run_and_signal(training(config, killed, resume), milliseconds(40 + 37 * attempt), SIGKILL);
    if (status == 0) break;
    EXPECT_EQ(status, 128 + SIGKILL);
    if (!std::filesystem::exists(folder.path("killed.checkpoint"))) continue;
    begun = true;
    EXPECT_TRUE(checkpoint_options(folder.path("killed.checkpoint")));
    for (const std::string& model : {killed, folder.path("killed.last.safetensors")})
      EXPECT_TRUE(!std::filesystem::exists(model) || load_model(model)) << model;
  }
  EXPECT_TRUE(begun);
  const Finished finished = run_command({"train", "--resume", "--out", killed, "--backend", "cpu"});
  ASSERT_EQ(finished.status, 0) << finished.err;
  expect_same_tensors(folder.path("straight.checkpoint"), folder.path("killed.checkpoint"));
  expect_same_tensors(straight, killed);
}

TEST(Train, InterruptedItStopsWithACheckpoint) {
  const Folder folder;
  const std::string out = folder.path("m.safetensors");
  for (const int signal : {SIGINT, SIGTERM}) {
    const int status =
        run_and_signal(training(folder.write("small.json", small), out, {"--steps", "1000000", "--resume"}),
                       milliseconds(1500), signal);
    EXPECT_EQ(status, 0);
  }
  const std::string bytes = read_text(folder.path("m.checkpoint"));
  const auto map = io::parse_safetensors(std::as_bytes(std::span(bytes)), "m.checkpoint");
  ASSERT_TRUE(map) << map.error().message;
  const auto state = nlohmann::json::parse(map->metadata.at("bitr.checkpoint"));
  EXPECT_GT(state["step"], 1);
  const std::string lines = read_text(folder.path("m.metrics.jsonl"));
  EXPECT_EQ(lines.back(), '\n');
}

TEST(Train, LeavesOutMeshesThatCannotBeRead) {
  const Folder folder, shapes;
  const std::string out = folder.path("m.safetensors"), config = folder.write("small.json", small);
  shapes.write("broken.obj", "v 0 0\nf 1 2 3\n");
  const Finished hopeless = run_command(training(config, out, {"--data", shapes.path()}));
  EXPECT_EQ(hopeless.status, 2);
  EXPECT_THAT(hopeless.err, testing::MatchesRegex("bitr: [^\n]*broken[^\n]*\n"));
  EXPECT_THAT(folder.names(), testing::ElementsAre("small.json"));

  for (int i = 0; i < 3; ++i)
    shapes.write("tetrahedron" + std::to_string(i) + ".obj",
                 "v 0 0 0\nv 1 0 0\nv 0 2 0\nv 0 0 3\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n");
  const Finished finished = run_command(training(config, out, {"--data", shapes.path()}));
  EXPECT_EQ(finished.status, 0) << finished.err;
  EXPECT_THAT(finished.err, testing::MatchesRegex("bitr: warning: 1 shape cannot be used; broken[^\n]*\n"));
}

TEST(Train, SaysWhenNothingCanBeWritten) {
  const Folder folder;
  const std::string out = folder.path("m.safetensors");
  std::filesystem::create_symlink("/dev/full", out);
  const Finished finished = run_command(training(folder.write("small.json", small), out));
  EXPECT_NE(finished.status, 0);
  EXPECT_THAT(finished.err, HasSubstr("m.safetensors: cannot write: No space left on device"));
}

TEST(Train, RefusesBadUsage) {
  const Folder folder;
  const std::string out = folder.path("m.safetensors");
  const std::string bad = folder.write("bad.json", "{\"optimizer\": {\"lr\": 7}}");
  const std::vector<std::pair<std::vector<std::string>, std::string>> wrong = {
      {{"--kind", "aircraft"}, "--out is required"},
      {{"--out", out}, "nothing to train on"},
      {{"--out", out, "--resume"}, "nothing to train on"},
      {{"--kind", "aircraft", "--out", folder.path("m.bin")}, "m.bin: must end in .safetensors"},
      {{"--kind", "aircraft", "--out", folder.path("no/m.safetensors")}, "its folder does not exist"},
      {{"--kind", "submarines", "--out", out}, "unknown kind \"submarines\""},
      {{"--data", folder.path("nowhere"), "--out", out}, "nowhere"},
      {{"--kind", "aircraft", "--out", out, "--steps", "0"},
       "--steps 0: steps is 0, must be a whole number in 1"},
      {{"--kind", "aircraft", "--out", out, "--minutes", "-1"}, "--minutes -1: minutes is -1"},
      {{"--kind", "aircraft", "--out", out, "--set", "steps"}, "--set steps: must be KEY=VALUE"},
      {{"--kind", "aircraft", "--out", out, "--set", "step=3"}, "--set step=3: step is no setting"},
      {{"--kind", "aircraft", "--out", out, "--init", "nowhere.safetensors"}, "nowhere.safetensors"},
      {{"--kind", "aircraft", "--out", out, "--set", "data.points=60"}, "clouds of less than 97 points"},
      {{bad, "--kind", "aircraft", "--out", out}, "bad.json: optimizer.lr is 7, must be a number in 0 … 1"},
      {{folder.path("none.json"), "--out", out}, "none.json"},
  };
  for (const auto& [options, message] : wrong) {
    std::vector<std::string> words = {"train", "--backend", "cpu"};
    words.insert(words.end(), options.begin(), options.end());
    const Finished finished = run_command(words);
    EXPECT_EQ(finished.status, 2) << testing::PrintToString(options);
    EXPECT_THAT(finished.err, testing::MatchesRegex("bitr: [^\n]*\n"));
    EXPECT_THAT(finished.err, HasSubstr(message));
    EXPECT_THAT(folder.names(), testing::ElementsAre("bad.json"));
  }
}

TEST(Train, DoesNotReplaceARunUnasked) {
  const Folder folder;
  const std::string out = folder.path("m.safetensors"), config = folder.write("small.json", small);
  ASSERT_EQ(run_command(training(config, out, {"--steps", "2"})).status, 0);
  const Finished again = run_command(training(config, out, {"--steps", "2"}));
  EXPECT_EQ(again.status, 2);
  EXPECT_THAT(again.err, HasSubstr("m.checkpoint: a run is there already"));
}

}  // namespace
}  // namespace bitr::test
