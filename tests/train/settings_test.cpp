#include <gmock/gmock.h>

#include <bitr/train.hpp>

namespace bitr {
namespace {

using testing::HasSubstr;

std::string error_of(const std::string& json, const std::vector<TrainOverride>& overrides = {}) {
  const auto options = parse_train_options(json, "run.json", overrides);
  return options ? "no error" : options.error().message;
}

TEST(Settings, AllOfThemComeBackAsTheyWereWritten) {
  TrainOptions options;
  options.model.num_channels = 8;
  options.model.return_normals = false;
  options.mode = Mode::reference;
  options.seed = 18446744073709551615ull;
  options.init = "some model";
  options.widen = {.num_channels = 8, .feature_num_channels = 12, .predict_head = 3};
  options.loss = TrainLoss::robust;
  options.optimizer = {
      .lr = 1.25e-4, .beta1 = 0.5, .beta2 = 0.6, .eps = 1e-7, .clip_value = 1, .clip_norm = 0};
  options.schedule = {.warmup = 7, .floor = 0.1};
  options.data.parts = {{.kind = "aircraft", .shapes = 5, .protocol = Protocol::complement, .weight = 2},
                        {.folder = "some where", .share_low = 0.1, .share_high = 0.2}};
  options.data.points_low = 17;
  options.split = ShapeSplit::none;
  options.validation.parts = {{.kind = "vessels"}};
  options.validation.patience = 3;
  options.minutes = 1.5;
  const std::string json = to_json(options);
  const auto read = parse_train_options(json, "run.json");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(to_json(*read), json);
  EXPECT_EQ(read->model, options.model);
  EXPECT_EQ(read->seed, options.seed);
  EXPECT_EQ(read->data.parts[0].protocol, Protocol::complement);
  EXPECT_EQ(read->data.parts[1].protocol, std::nullopt);
  EXPECT_EQ(read->data.parts[1].folder, "some where");
  EXPECT_FALSE(read->data.normals) << "as the model wants them";
}

TEST(Settings, MissingOnesKeepTheirDefaultsAndCommentsAreAllowed) {
  const auto options = parse_train_options(
      "{ // a comment\n \"data\": {\"parts\": [{\"kind\": \"aircraft\"}], /* another */ \"points\": 300}}",
      "run.json");
  ASSERT_TRUE(options) << options.error().message;
  EXPECT_EQ(options->data.points_low, 300u);
  EXPECT_EQ(options->data.points_high, 300u);
  EXPECT_EQ(options->steps, TrainOptions().steps);
  EXPECT_EQ(options->model, TrainOptions::trainable_config());
}

TEST(Settings, ErrorsNameFileKeyValueAndLimit) {
  EXPECT_THAT(error_of("{"), HasSubstr("run.json: byte 2: not valid JSON"));
  EXPECT_EQ(error_of("{\"steps\": 1e999}"), "run.json: 1e999 is beyond the largest number, about 1.8e308");
  EXPECT_EQ(error_of("{}", {{"steps", "1e999", "--set steps=1e999"}}),
            "--set steps=1e999: steps is \"1e999\", must be a whole number in 1 … 1000000000");
  EXPECT_THAT(error_of("[]"), HasSubstr("run.json: holds array, not an object"));
  EXPECT_EQ(error_of("{\"optimizer\": {\"lr\": 2}}"),
            "run.json: optimizer.lr is 2, must be a number in 0 … 1");
  EXPECT_EQ(error_of("{\"optimizer\": {\"lr\": \"x\"}}"),
            "run.json: optimizer.lr is \"x\", must be a number in 0 … 1");
  EXPECT_EQ(error_of("{\"steps\": 0}"), "run.json: steps is 0, must be a whole number in 1 … 1000000000");
  EXPECT_EQ(error_of("{\"steps\": 1.5}"), "run.json: steps is 1.5, must be a whole number in 1 … 1000000000");
  EXPECT_EQ(error_of("{\"batch\": -1}"), "run.json: batch is -1, must be a whole number in 1 … 4096");
  EXPECT_EQ(error_of("{\"loss\": \"l1\"}"),
            "run.json: loss is \"l1\", must be one of \"direct\", \"robust\", \"official\"");
  EXPECT_EQ(error_of("{\"optimizer\": 3}"), "run.json: optimizer is 3, must be an object");
  EXPECT_EQ(error_of("{\"data\": {\"parts\": {}}}"),
            "run.json: data.parts is object, must be a list of objects");
  EXPECT_EQ(error_of("{\"data\": {\"parts\": [{}, {\"share\": [0.5, 2]}]}}"),
            "run.json: data.parts.1.share is 2, must be a number in 1e-06 … 1");
  EXPECT_EQ(error_of("{\"data\": {\"points\": [9, 5]}}"),
            "run.json: data.points is [9,5], must not run backwards");
  EXPECT_EQ(error_of("{\"model\": {\"k_neighbor\": 65}}"),
            "run.json: model.k_neighbor is 65, must be 1 … 64");
  EXPECT_THAT(error_of("{\"model\": {\"num_key_points\": 8}}"),
              HasSubstr("run.json: model.re_convert_k is 24, must be below num_key_points = 8"));
}

TEST(Settings, UnknownKeysAreErrorsThatNameTheKnown) {
  EXPECT_THAT(error_of("{\"step\": 5}"),
              HasSubstr("run.json: step is no setting; there are accumulate, batch"));
  EXPECT_EQ(error_of("{\"schedule\": {\"warm\": 5}}"),
            "run.json: schedule.warm is no setting; there are floor, warmup");
  EXPECT_THAT(error_of("{\"model\": {\"layers\": 5}}"),
              HasSubstr("model.layers is no setting; there are centroid_offset, div"));
  EXPECT_THAT(error_of("{\"data\": {\"parts\": [{\"kinds\": \"aircraft\"}]}}"),
              HasSubstr("data.parts.0.kinds is no setting"));
}

TEST(Settings, OverridesReplaceWhatTheFileSays) {
  const std::string json =
      "{\"optimizer\": {\"lr\": 0.5, \"eps\": 1e-3}, \"data\": {\"parts\": [{\"kind\": \"aircraft\"}]}}";
  const std::vector<TrainOverride> overrides = {{"optimizer.lr", "0.25", "--set optimizer.lr=0.25"},
                                                {"data.parts.0.share", "[0.5, 0.6]", "--set …"},
                                                {"data.parts.1.folder", "meshes", "--set …"},
                                                {"validation.every", "9", "--set …"}};
  const auto options = parse_train_options(json, "run.json", overrides);
  ASSERT_TRUE(options) << options.error().message;
  EXPECT_EQ(options->optimizer.lr, 0.25);
  EXPECT_EQ(options->optimizer.eps, 1e-3);
  EXPECT_EQ(options->data.parts[0].share_high, 0.6);
  EXPECT_EQ(options->data.parts[1].folder, "meshes");
  EXPECT_EQ(options->validation.every, 9u);

  EXPECT_THAT(error_of(json, {{"optimizer.lr", "-1", "--set optimizer.lr=-1"}}),
              HasSubstr("--set optimizer.lr=-1: optimizer.lr is -1"));
  EXPECT_THAT(
      error_of("{\"optimizer\": {\"lr\": 5}}", {{"optimizer.eps", "1e-9", "--set optimizer.eps=1e-9"}}),
      HasSubstr("run.json: optimizer.lr is 5"));
  EXPECT_THAT(error_of(json, {{"data.parts.7.kind", "aircraft", "--set X"}}),
              HasSubstr("--set X: \"7\" is not in 0 … 1"));
  EXPECT_THAT(error_of(json, {{"a..b", "1", "--set X"}}), HasSubstr("--set X: a part of the key is empty"));
  EXPECT_THAT(error_of(json, {{"no.such", "1", "--set no.such=1"}}),
              HasSubstr("--set no.such=1: no is no setting"));
}

}  // namespace
}  // namespace bitr
