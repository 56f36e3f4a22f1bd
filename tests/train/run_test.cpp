#include "train/run.hpp"

#include <gmock/gmock.h>
#include <sys/resource.h>

#include <array>
#include <bitr/io.hpp>
#include <csignal>
#include <fstream>
#include <nlohmann/json.hpp>

#include "api/internal.hpp"
#include "bowl.hpp"
#include "train/checkpoint.hpp"

namespace bitr::train {
namespace {

using test::Bowl;
using test::small_options;
using testing::HasSubstr;

class RunTest : public testing::Test {
 protected:
  RunTest() {
    std::string pattern = (std::filesystem::temp_directory_path() / "bitr_train_XXXXXX").string();
    EXPECT_NE(mkdtemp(pattern.data()), nullptr);
    folder_ = pattern;
  }
  ~RunTest() override { std::filesystem::remove_all(folder_); }

  TrainFiles files(const std::string& name) const { return {folder_ / (name + ".safetensors")}; }

  TrainSummary train(const TrainOptions& options, const TrainFiles& files, bool resume = false,
                     const TrainCallbacks& callbacks = {}) {
    return run(cpu_device(1), options, files, resume, callbacks, [this](const model::Weights&) {
      auto bowl = std::make_unique<Bowl>();
      bowl->poisoned = poisoned_;
      return bowl;
    });
  }

  Error error_of(const std::function<void()>& action) {
    try {
      action();
    } catch (const Failure& failure) {
      return failure.error();
    }
    ADD_FAILURE() << "nothing was thrown";
    return {};
  }

  std::vector<nlohmann::json> lines(const TrainFiles& files) const {
    std::vector<nlohmann::json> all;
    std::ifstream file(files.metrics());
    for (std::string line; std::getline(file, line);) all.push_back(nlohmann::json::parse(line));
    return all;
  }

  TrainState state_of(const TrainFiles& files) const {
    return parse_checkpoint(io::read_file(files.checkpoint()).value(), "checkpoint").value().state;
  }

  std::size_t count_files() const {
    return static_cast<std::size_t>(std::distance(std::filesystem::directory_iterator(folder_), {}));
  }

  std::filesystem::path folder_;
  std::function<bool(int)> poisoned_ = [](int) { return false; };
};

TEST_F(RunTest, WritesAModelThatLoadsAndSaysHowItWasMade) {
  TrainOptions options = small_options();
  options.validation = {.every = 8, .samples = 3};
  options.log_every = 5;
  const TrainSummary summary = train(options, files("a"));
  EXPECT_EQ(summary.end, TrainEnd::finished);
  EXPECT_EQ(summary.step, 20u);
  ASSERT_TRUE(summary.best_score);

  for (const auto& path : {files("a").model, files("a").last()}) {
    const auto model = load_model(path);
    ASSERT_TRUE(model) << model.error().message;
    EXPECT_TRUE(model->trained());
    EXPECT_EQ(model->config(), options.model);
    const auto& metadata = Internal::weights(*model).metadata;
    EXPECT_EQ(metadata.at("bitr.points_low"), "40");
    EXPECT_EQ(metadata.at("bitr.points_high"), "60");
    EXPECT_EQ(metadata.at("bitr.cloud_points_low"), "40");
    EXPECT_EQ(metadata.at("bitr.cloud_points_high"), "60");
    const auto stored = parse_train_options(metadata.at("bitr.training"), "metadata");
    ASSERT_TRUE(stored) << stored.error().message;
    EXPECT_EQ(to_json(*stored), to_json(options));
  }
  std::vector<std::size_t> steps, validations;
  for (const auto& line : lines(files("a")))
    (line.contains("validation") ? validations : steps).push_back(line["step"]);
  EXPECT_THAT(steps, testing::ElementsAre(5, 10, 15, 20));
  EXPECT_THAT(validations, testing::ElementsAre(8, 16, 20));
  EXPECT_TRUE(std::filesystem::exists(files("a").curves()));
  EXPECT_EQ(count_files(), 5u) << "nothing temporary is left";
}

TEST_F(RunTest, TellsHowManyPointsACropLeaves) {
  TrainOptions options = small_options();
  options.steps = 1;
  options.data.points_low = 100;
  options.data.points_high = 200;
  options.data.parts[0].share_low = 0.4;
  options.data.parts[0].share_high = 0.7;
  using Expected = std::array<const char*, 2>;
  for (const auto& [protocol, expected] :
       {std::pair{Protocol::opposed, Expected{"40", "140"}}, {Protocol::complement, Expected{"30", "140"}}}) {
    options.data.parts[0].protocol = protocol;
    const TrainFiles out = files(std::string(bitr::name(protocol)));
    train(options, out);
    const auto metadata = Internal::weights(*load_model(out.model)).metadata;
    EXPECT_EQ(metadata.at("bitr.cloud_points_low"), expected[0]);
    EXPECT_EQ(metadata.at("bitr.cloud_points_high"), expected[1]);
  }
}

TEST_F(RunTest, StoppedAndResumedIsTheSame) {
  TrainOptions options = small_options();
  options.validation = {.every = 6, .samples = 2};
  options.log_every = 4;
  train(options, files("straight"));

  int steps = 0;
  const TrainSummary stopped =
      train(options, files("halves"), false, {.progress = {}, .stop = [&] { return ++steps == 10; }});
  EXPECT_EQ(stopped.end, TrainEnd::stopped);
  EXPECT_EQ(stopped.step, 10u);
  const TrainSummary resumed = train(options, files("halves"), true);
  EXPECT_EQ(resumed.first_step, 10u);
  EXPECT_EQ(resumed.end, TrainEnd::finished);

  const TrainState a = state_of(files("straight")), b = state_of(files("halves"));
  EXPECT_EQ(a.weights, b.weights);
  EXPECT_EQ(a.adam.first, b.adam.first);
  EXPECT_EQ(a.adam.second, b.adam.second);
  EXPECT_EQ(a.average, b.average);
  EXPECT_EQ(a.position.index, b.position.index);
  EXPECT_EQ(a.best_score, b.best_score);
  const auto one = lines(files("straight")), two = lines(files("halves"));
  ASSERT_EQ(one.size(), two.size());
  for (std::size_t i = 0; i < one.size(); ++i) EXPECT_EQ(one[i]["step"], two[i]["step"]);
}

TEST_F(RunTest, ResumingDropsMetricsPastTheCheckpointAndHalfALine) {
  TrainOptions options = small_options();
  options.log_every = 2;
  options.steps = 6;
  train(options, files("a"));
  std::ofstream(files("a").metrics(), std::ios::app)
      << "{\"step\":8,\"rotation\":1,\"translation\":1,\"spread\":0}\n{\"step\":9,\"rot";
  options.steps = 8;
  train(options, files("a"), true);
  std::vector<std::size_t> steps;
  for (const auto& line : lines(files("a"))) steps.push_back(line["step"]);
  EXPECT_THAT(steps, testing::ElementsAre(2, 4, 6, 8));
  EXPECT_TRUE(lines(files("a")).back().contains("lr"));
}

TEST_F(RunTest, StopsOnTimeAndEarly) {
  TrainOptions options = small_options();
  options.minutes = 1e-6;
  EXPECT_EQ(train(options, files("time")).end, TrainEnd::time_limit);
  EXPECT_EQ(state_of(files("time")).step, 1u);

  options.minutes = 0;
  options.optimizer.lr = 0;  // every validation is the first again
  options.validation = {.every = 2, .samples = 2, .patience = 3};
  const TrainSummary early = train(options, files("early"));
  EXPECT_EQ(early.end, TrainEnd::early);
  EXPECT_EQ(early.step, 8u);
  EXPECT_EQ(early.best_step, 2u);
  EXPECT_EQ(train(options, files("early"), true).step, 8u);
}

TEST_F(RunTest, KeepsTheLastGoodCheckpointWhenNothingIsFinite) {
  TrainOptions options = small_options();
  options.checkpoint = {.seconds = 0, .steps = 1};
  poisoned_ = [](int n) { return n > 4; };
  const Error error = error_of([&] { train(options, files("a")); });
  EXPECT_EQ(error.code, ErrorCode::internal);
  EXPECT_EQ(state_of(files("a")).step, 4u);
  EXPECT_EQ(state_of(files("a")).skipped_steps, 0u);
  poisoned_ = [](int) { return false; };
  EXPECT_EQ(train(options, files("a"), true).step, 20u);
}

TEST_F(RunTest, DoesNotReplaceARunUnasked) {
  const TrainOptions options = small_options();
  train(options, files("a"));
  EXPECT_THAT(error_of([&] { train(options, files("a")); }).message,
              HasSubstr("a run is there already: go on with it by --resume"));
  TrainOptions other = options;
  other.model.k_neighbor = 9;
  EXPECT_THAT(error_of([&] { train(other, files("a"), true); }).message,
              HasSubstr("is of a run with another model configuration"));
  other = options;
  other.seed = 5;
  EXPECT_THAT(error_of([&] { train(other, files("a"), true); }).message, HasSubstr("another seed"));
  other = options;
  other.data.noise = 0.5;
  EXPECT_THAT(error_of([&] { train(other, files("a"), true); }).message,
              HasSubstr("a.checkpoint: is of a run with other data"));
}

TEST_F(RunTest, DoesNotReplaceAModelUnasked) {
  const TrainOptions options = small_options();
  train(options, files("a"));
  std::filesystem::remove(files("a").checkpoint());
  for (const bool resume : {false, true})
    EXPECT_THAT(error_of([&] { train(options, files("a"), resume); }).message,
                HasSubstr("a.safetensors: a model is there already"));
}

TEST_F(RunTest, ModelsThatTheCheckpointLacksAreMadeAgain) {
  TrainOptions options = small_options();
  train(options, files("a"));
  const auto model = io::read_file(files("a").model).value();
  std::filesystem::remove(files("a").model);
  std::filesystem::remove(files("a").last());
  EXPECT_EQ(train(options, files("a"), true).first_step, 20u);
  EXPECT_EQ(io::read_file(files("a").model).value(), model);
  EXPECT_EQ(io::read_file(files("a").last()).value(), model);
}

TEST_F(RunTest, StartsFromAnotherModelThatNeedNotStay) {
  TrainOptions options = small_options();
  train(options, files("first"));
  options.init = files("first").model;
  options.model.k_neighbor = 16;  // the file's counts
  options.optimizer.lr = 0;
  options.steps = 2;
  train(options, files("second"));
  const auto first = load_model(files("first").model), second = load_model(files("second").model);
  EXPECT_EQ(second->config().k_neighbor, 8);
  for (const auto& [name, matrix] : Internal::weights(*first).parameters)
    ASSERT_EQ(matrix, Internal::weights(*second).parameters.at(name)) << name;
  std::filesystem::remove(files("first").model);
  options.steps = 3;
  EXPECT_EQ(train(options, files("second"), true).step, 3u);
}

TEST_F(RunTest, FullDiskLeavesTheOlderCheckpoint) {
  TrainOptions options = small_options();
  options.steps = 2;
  train(options, files("a"));
  const auto before = io::read_file(files("a").checkpoint()).value();

  options.steps = 4;
  rlimit old{};
  getrlimit(RLIMIT_FSIZE, &old);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit tight{before.size() - 100, old.rlim_max};
  setrlimit(RLIMIT_FSIZE, &tight);
  const Error error = error_of([&] { train(options, files("a"), true); });
  setrlimit(RLIMIT_FSIZE, &old);
  std::signal(SIGXFSZ, handler);

  EXPECT_EQ(error.code, ErrorCode::io);
  EXPECT_THAT(error.message, HasSubstr("a.checkpoint: cannot write: File too large"));
  EXPECT_EQ(io::read_file(files("a").checkpoint()).value(), before);
  EXPECT_EQ(train(options, files("a"), true).step, 4u);
}

}  // namespace
}  // namespace bitr::train
