// Weights from files: the committed ones, and every way a file can be wrong.
#include <gmock/gmock.h>

#include <cmath>
#include <limits>

#include "api/internal.hpp"
#include "model/config.hpp"
#include "model/parameters.hpp"
#include "support/golden.hpp"

namespace bitr {
namespace {

using testing::AllOf;
using testing::HasSubstr;

TensorMap saved(const ModelConfig& config = {}, std::uint64_t seed = 1) {
  return model::tensors_from_weights(model::initial_weights(config, seed, Mode::scale_exact));
}

TensorMap without_metadata(TensorMap map) {
  map.metadata.clear();
  return map;
}

// The message with which a map is refused.
std::string refusal(const TensorMap& map) {
  const auto weights = model::weights_from_tensors(map, {.name = "some.safetensors", .mode = {}});
  if (weights) return "accepted";
  EXPECT_EQ(weights.error().code, ErrorCode::bad_file);
  EXPECT_THAT(weights.error().message, HasSubstr("some.safetensors"));
  return weights.error().message;
}

constexpr const char* some_name = "feature_extract.Gblock.2.GMAB.q.transform.(1, 0)";

TEST(Load, TheCommittedWeights) {
  for (const auto& [file, normals, parameters] : {std::tuple("weights_01.safetensors", false, 161316u),
                                                  std::tuple("weights_02.safetensors", true, 164348u)}) {
    const auto model = load_model(test::golden_path(file));
    ASSERT_TRUE(model) << model.error().message;
    EXPECT_EQ(model->config().return_normals, normals);
    EXPECT_EQ(model->parameter_count(), parameters);
    EXPECT_EQ(model->mode(), Mode::reference);
    EXPECT_TRUE(model->trained());
    EXPECT_EQ(model->name(), std::string(file).substr(0, 10));
    ModelConfig expected;
    expected.return_normals = normals;
    EXPECT_EQ(model->config(), expected);
    const auto exact = load_model(test::golden_path(file), {.name = "x", .mode = Mode::scale_exact});
    EXPECT_EQ(exact->mode(), Mode::scale_exact);
  }
}

// Every official name, aliases and buffers included.
TEST(Load, TheTorchCheckpoint) {
  const auto model = load_torch_checkpoint(test::golden_path("checkpoint_00_state_dict.pt"));
  ASSERT_TRUE(model) << model.error().message;
  EXPECT_EQ(model->config(), ModelConfig{});
  EXPECT_EQ(model->parameter_count(), 161316u);
  EXPECT_EQ(model->mode(), Mode::reference);
  const auto path = test::golden_path("weights_00.safetensors");
  if (!std::filesystem::exists(path)) GTEST_SKIP() << path << " is absent";
  const auto same = load_model(path);
  ASSERT_TRUE(same) << same.error().message;
  EXPECT_EQ(Internal::weights(*same).parameters, Internal::weights(*model).parameters);
}

TEST(Load, WhatWasSavedIsLoaded) {
  ModelConfig config;
  config.return_normals = true;
  config.k_neighbor = 17;
  config.heads = 1;
  for (const Mode mode : {Mode::scale_exact, Mode::reference}) {
    const Model model = untrained_model(config, 5, mode).value();
    const auto bytes = serialize(model);
    const auto loaded = load_model(bytes, {.name = "copy", .mode = {}});
    ASSERT_TRUE(loaded) << loaded.error().message;
    EXPECT_EQ(Internal::weights(*loaded).parameters, Internal::weights(model).parameters);
    EXPECT_EQ(loaded->config(), config);
    EXPECT_EQ(loaded->mode(), mode);
    EXPECT_FALSE(loaded->trained());
    EXPECT_EQ(loaded->name(), "copy");
    EXPECT_EQ(serialize(*loaded), bytes);
  }
}

TEST(Load, HalvesAreTheNearest) {
  model::Weights weights = model::initial_weights({}, 5, Mode::scale_exact);
  const std::string name = "Binet.Gblock.0.GMAB.vk.rp.((0, 0),(0, 0)).net.3.weight";
  Eigen::MatrixXd& matrix = weights.parameters.at(name);
  // Ties go to even; the largest, the least normal and the least subnormal number, and half of that.
  const std::vector<std::pair<double, double>> known = {{1 + 1.0 / 2048, 1},
                                                        {1 + 3.0 / 2048, 1 + 1.0 / 512},
                                                        {-1.0 / 3, -1365.0 / 4096},
                                                        {65519, 65504},
                                                        {1e-30, 0},
                                                        {0x1p-14, 0x1p-14},
                                                        {-0x1p-24, -0x1p-24},
                                                        {0x1p-25, 0},
                                                        {2047.75 / 1024, 2},
                                                        {0x1.fffp-15, 0x1p-14}};
  for (std::size_t i = 0; i < known.size(); ++i) matrix(static_cast<Eigen::Index>(i), 0) = known[i].first;
  const Model model = Internal::model(std::make_shared<const model::Weights>(weights));
  const auto halved = load_model(serialize(model, WeightPrecision::f16));
  ASSERT_TRUE(halved) << halved.error().message;
  const Eigen::MatrixXd& found = Internal::weights(*halved).parameters.at(name);
  for (std::size_t i = 0; i < known.size(); ++i)
    EXPECT_EQ(found(static_cast<Eigen::Index>(i), 0), known[i].second) << known[i].first;
  for (const auto& [other, exact] : weights.parameters) {
    const Eigen::ArrayXXd off = (Internal::weights(*halved).parameters.at(other) - exact).array().abs();
    EXPECT_TRUE((off <= exact.array().abs() * 0x1p-11 + 0x1p-25).all()) << other;
  }
  // What has 16 bits stays as it is.
  EXPECT_EQ(Internal::weights(*load_model(serialize(*halved, WeightPrecision::f16))).parameters,
            Internal::weights(*halved).parameters);

  matrix(0, 0) = 65520;
  const auto infinite = load_model(
      serialize(Internal::model(std::make_shared<const model::Weights>(weights)), WeightPrecision::f16));
  ASSERT_FALSE(infinite);
  EXPECT_THAT(infinite.error().message, HasSubstr("non-finite"));
}

TEST(Load, KeepsForeignMetadata) {
  TensorMap map = saved();
  map.metadata["training.steps"] = "12345";
  const auto weights = model::weights_from_tensors(map, {});
  ASSERT_TRUE(weights);
  EXPECT_EQ(model::tensors_from_weights(*weights).metadata.at("training.steps"), "12345");
}

TEST(Load, AliasesMayBePresentAndMustAgree) {
  const auto dict = model::state_dict({});
  TensorMap map = saved();
  for (const auto& [alias, canonical] : dict.aliases) map.tensors[alias] = map.tensors.at(canonical);
  map.tensors["predict_head.Q"] = Tensor::from({3, 3}, std::vector<float>(9, 0));
  EXPECT_EQ(refusal(map), "accepted");

  for (const std::string& alias : {dict.aliases.begin()->first, std::prev(dict.aliases.end())->first}) {
    TensorMap wrong = map;
    wrong.tensors[alias].bytes[2] ^= std::byte{0x40};
    EXPECT_THAT(refusal(wrong), AllOf(HasSubstr("disagrees"), HasSubstr(dict.aliases.at(alias))));
    // A file may hold the alias alone.
    TensorMap alone = map;
    for (const auto& [other, canonical] : dict.aliases)
      if (canonical == dict.aliases.at(alias) && other != alias) alone.tensors.erase(other);
    alone.tensors.erase(dict.aliases.at(alias));
    EXPECT_EQ(refusal(alone), "accepted");
  }
}

TEST(Load, AMissingTensorIsNamed) {
  // Every single one, with the configuration given; a few of them also decide what is inferred.
  for (const auto& spec : model::state_dict({}).parameters) {
    TensorMap map = saved();
    map.tensors.erase(spec.name);
    ASSERT_THAT(refusal(map), AllOf(HasSubstr(spec.name), HasSubstr("missing")));
  }
  TensorMap bare = without_metadata(saved());
  bare.tensors.erase(some_name);
  EXPECT_THAT(refusal(bare), AllOf(HasSubstr(some_name), HasSubstr("missing")));
  EXPECT_THAT(refusal({}), AllOf(HasSubstr("not a BITR state dict"), HasSubstr("missing")));
}

TEST(Load, AnExtraTensorIsNamed) {
  TensorMap map = saved();
  map.tensors["decoder.weight"] = Tensor::from({2}, std::vector<float>{1, 2});
  EXPECT_THAT(refusal(map), AllOf(HasSubstr("decoder.weight"), HasSubstr("does not belong")));
  EXPECT_THAT(refusal(without_metadata(map)), HasSubstr("decoder.weight"));
}

TEST(Load, AWrongShapeIsNamedWithBothShapes) {
  TensorMap map = saved();
  map.tensors[some_name] = Tensor::from({2, 5}, std::vector<float>(10, 1));
  EXPECT_THAT(refusal(map), AllOf(HasSubstr(some_name), HasSubstr("[2, 5]"), HasSubstr("[2, 4]")));
  map.tensors[some_name] = Tensor::from({8}, std::vector<float>(8, 1));
  EXPECT_THAT(refusal(map), AllOf(HasSubstr(some_name), HasSubstr("[8]")));
  map.tensors[some_name] = Tensor::from({}, std::vector<float>{1});
  EXPECT_THAT(refusal(map), AllOf(HasSubstr(some_name), HasSubstr("[]")));
}

TEST(Load, AWrongTypeIsNamed) {
  TensorMap map = saved();
  map.tensors[some_name] = Tensor::from({2, 4}, std::vector<std::int64_t>(8, 1));
  EXPECT_THAT(refusal(map), AllOf(HasSubstr(some_name), HasSubstr("I64")));
  // Doubles are as good as floats.
  map.tensors[some_name] = Tensor::from({2, 4}, std::vector<double>(8, 0.1));
  const auto weights = model::weights_from_tensors(map, {});
  ASSERT_TRUE(weights) << weights.error().message;
  EXPECT_EQ(weights->parameters.at(some_name)(1, 3), 0.1);
}

TEST(Load, ANonFiniteWeightIsNamed) {
  for (const float bad : {std::nanf(""), std::numeric_limits<float>::infinity()}) {
    TensorMap map = saved();
    std::vector<float> values(8, 0.5f);
    values[6] = bad;
    map.tensors[some_name] = Tensor::from({2, 4}, values);
    EXPECT_THAT(refusal(map), AllOf(HasSubstr(some_name), HasSubstr("non-finite"), HasSubstr("element 6")));
  }
}

TEST(Load, RowsAndColumnsAreNotExchanged) {
  TensorMap map = saved();
  map.tensors[some_name] = Tensor::from({2, 4}, std::vector<float>{0, 1, 2, 3, 10, 11, 12, 13});
  const auto weights = model::weights_from_tensors(map, {});
  ASSERT_TRUE(weights);
  EXPECT_EQ(weights->parameters.at(some_name)(0, 3), 3);
  EXPECT_EQ(weights->parameters.at(some_name)(1, 0), 10);
}

TEST(Load, MetadataThatIsWrongIsNamed) {
  const auto with = [](const std::string& key, const std::string& value) {
    TensorMap map = saved();
    map.metadata[key] = value;
    return refusal(map);
  };
  EXPECT_THAT(with("bitr.config", "{"), HasSubstr("bitr.config is not a JSON object"));
  EXPECT_THAT(with("bitr.config", "[1]"), HasSubstr("bitr.config is not a JSON object"));
  EXPECT_THAT(with("bitr.config", R"({"k_neighbor": 0})"),
              AllOf(HasSubstr("bitr.config.k_neighbor is 0"), HasSubstr("1 … 64")));
  EXPECT_THAT(with("bitr.config", R"({"k_neighbor": 24.5})"), HasSubstr("k_neighbor is 24.5"));
  EXPECT_THAT(with("bitr.config", R"({"head": "2"})"), HasSubstr(R"(bitr.config.head is "2")"));
  EXPECT_THAT(with("bitr.config", R"({"num_channels": 4294967300})"),
              HasSubstr("num_channels is 4294967300"));
  EXPECT_THAT(with("bitr.config", R"({"num_channels": -9223372036854775808})"),
              HasSubstr("num_channels is -9223372036854775808"));
  EXPECT_THAT(with("bitr.config", R"({"num_channels": 18446744073709551615})"),
              HasSubstr("num_channels is 18446744073709551615"));
  EXPECT_THAT(with("bitr.config", R"({"return_normals": "yes"})"), HasSubstr("return_normals"));
  EXPECT_THAT(with("bitr.config", R"({"feature_max_deg": 2})"), HasSubstr("feature_max_deg is 2"));
  EXPECT_THAT(with("bitr.config", R"({"head": 3})"), HasSubstr("head = 3"));
  EXPECT_THAT(with("bitr.config", R"({"re_convert_k": 32})"), HasSubstr("re_convert_k is 32"));
  EXPECT_THAT(with("bitr.mode", "exact"), AllOf(HasSubstr("bitr.mode"), HasSubstr("\"exact\"")));
  EXPECT_EQ(with("bitr.config", "{}"), "accepted");
  EXPECT_EQ(with("bitr.mode", "reference"), "accepted");
  // A configuration the tensors do not fit.
  EXPECT_THAT(with("bitr.config", R"({"num_channels": 8})"), AllOf(HasSubstr("Binet"), HasSubstr("shape")));
  EXPECT_THAT(with("bitr.config", R"({"num_layers": 3})"), HasSubstr("Binet"));
}

TEST(Load, ErrorsOfFilesNameThePath) {
  const auto absent = load_model(std::filesystem::path("/nonexistent/model.safetensors"));
  ASSERT_FALSE(absent);
  EXPECT_EQ(absent.error().code, ErrorCode::io);
  EXPECT_THAT(absent.error().message, HasSubstr("/nonexistent/model.safetensors"));
  const auto wrong_kind = load_model(test::golden_path("checkpoint_00_state_dict.pt"));
  ASSERT_FALSE(wrong_kind);
  EXPECT_EQ(wrong_kind.error().code, ErrorCode::bad_file);
  const auto case_file = load_model(test::golden_path("case_04.safetensors"));
  ASSERT_FALSE(case_file);
  EXPECT_THAT(case_file.error().message, HasSubstr("not a BITR state dict"));
  const std::vector<std::byte> nothing;
  EXPECT_FALSE(load_model(nothing));
}

ModelConfig with(std::initializer_list<std::pair<int ModelConfig::*, int>> changes, bool normals = false,
                 bool colors = false) {
  ModelConfig config;
  for (const auto& [field, value] : changes) config.*field = value;
  config.return_normals = normals;
  config.get_color = colors;
  return config;
}

std::vector<ModelConfig> inferable() {
  using C = ModelConfig;
  return {
      with({}),
      with({}, true),
      with({}, false, true),
      with({}, true, true),
      with({{&C::key_global_merge_coe, 8}}),
      with({{&C::num_channels, 8}, {&C::predict_head, 3}}),
      with({{&C::feature_num_channels, 6}, {&C::div, 1}}),
      with({{&C::feature_num_channels, 12}, {&C::div, 3}, {&C::num_key_points, 36}, {&C::num_channels, 6}}),
      with({{&C::num_layers, 1}, {&C::feature_num_layers, 3}}),
      with({{&C::num_layers, 3}, {&C::feature_num_layers, 0}}, true),
      with({{&C::num_layers, 0}}),
      with({{&C::num_key_points, 64}, {&C::key_global_merge_coe, 1}})};
}

// Everything but heads and neighbour counts, which the shapes do not show and which are official here.
TEST(InferConfig, ReadsTheShapes) {
  for (const ModelConfig& config : inferable()) {
    const std::string json = model::to_json(config);
    ASSERT_TRUE(validate(config)) << json;
    const Model model = untrained_model(config, 2).value();
    auto map = io::parse_safetensors(serialize(model), "x");
    ASSERT_TRUE(map);
    map->metadata.clear();
    const auto bytes = io::serialize_safetensors(*map);
    const auto loaded = load_model(bytes);
    ASSERT_TRUE(loaded) << loaded.error().message << " from " << json;
    EXPECT_EQ(model::to_json(loaded->config()), json);
    EXPECT_EQ(Internal::weights(*loaded).parameters, Internal::weights(model).parameters);
    EXPECT_EQ(loaded->mode(), Mode::reference);
  }
}

TEST(InferConfig, FallsBackWhereTheOfficialDefaultsDoNotFit) {
  using C = ModelConfig;
  const ModelConfig config = with({{&C::num_key_points, 10},
                                   {&C::re_convert_k, 5},
                                   {&C::feature_num_channels, 5},
                                   {&C::div, 1},
                                   {&C::heads, 1},
                                   {&C::num_channels, 5}});
  const auto loaded = model::weights_from_tensors(without_metadata(saved(config)), {});
  ASSERT_TRUE(loaded) << loaded.error().message;
  EXPECT_EQ(loaded->config.re_convert_k, 9);
  EXPECT_EQ(loaded->config.heads, 1);
  EXPECT_EQ(loaded->config.num_channels, 5);
}

TEST(ConfigJson, RoundTrips) {
  for (ModelConfig config : inferable()) {
    config.heads = 1;
    config.k_neighbor = 64;
    config.key_mean_num = 1;
    const auto again = model::config_from_json(model::to_json(config), "x");
    ASSERT_TRUE(again) << again.error().message;
    EXPECT_EQ(*again, config);
  }
}

TEST(ConfigJson, TakesTheOfficialNamesAndNumbersForSwitches) {
  const auto config =
      model::config_from_json(R"({"head": 1, "return_normals": 1, "get_color": 0, "lr": 0.1})", "x");
  ASSERT_TRUE(config) << config.error().message;
  EXPECT_EQ(config->heads, 1);
  EXPECT_TRUE(config->return_normals);
  EXPECT_FALSE(config->get_color);
}

TEST(Validate, NamesTheFieldTheValueAndTheRange) {
  using C = ModelConfig;
  struct Range {
    const char* name;
    int C::*field;
    int low, high;
  };
  const Range ranges[] = {{"num_channels", &C::num_channels, 1, 256},
                          {"predict_head", &C::predict_head, 1, 64},
                          {"num_layers", &C::num_layers, 0, 16},
                          {"feature_num_layers", &C::feature_num_layers, 0, 16},
                          {"feature_max_deg", &C::feature_max_deg, 1, 1},
                          {"feature_num_channels", &C::feature_num_channels, 1, 256},
                          {"div", &C::div, 1, 64},
                          {"head", &C::heads, 1, 64},
                          {"k_neighbor", &C::k_neighbor, 1, 64},
                          {"re_convert_k", &C::re_convert_k, 1, 64},
                          {"num_key_points", &C::num_key_points, 2, 1024},
                          {"key_mean_num", &C::key_mean_num, 1, 64},
                          {"key_global_merge_coe", &C::key_global_merge_coe, 1, 256}};
  EXPECT_TRUE(validate({}));
  for (const Range& range : ranges)
    for (const int value : {range.low - 1, range.high + 1, -2147483647}) {
      ModelConfig config;
      config.*range.field = value;
      const auto result = validate(config);
      ASSERT_FALSE(result) << range.name;
      EXPECT_EQ(result.error().code, ErrorCode::invalid_argument);
      EXPECT_THAT(result.error().message,
                  AllOf(HasSubstr(std::string(range.name) + " is " + std::to_string(value)),
                        HasSubstr(std::to_string(range.low) + " … " + std::to_string(range.high))));
      EXPECT_FALSE(untrained_model(config));
    }
}

TEST(Validate, ChannelsMustSplitIntoHeads) {
  using C = ModelConfig;
  EXPECT_THAT(validate(with({{&C::feature_num_channels, 3}})).error().message,
              HasSubstr("feature_num_channels / div is 3 / 2"));
  EXPECT_THAT(validate(with({{&C::num_channels, 2}})).error().message,
              HasSubstr("num_channels / div is 2 / 2"));
  EXPECT_THAT(validate(with({{&C::div, 8}})).error().message, HasSubstr("4 / 8"));
  EXPECT_THAT(validate(with({{&C::num_key_points, 24}})).error().message,
              AllOf(HasSubstr("re_convert_k is 24"), HasSubstr("24")));
  // Without hidden two-sided layers their channels do not matter.
  EXPECT_TRUE(validate(with({{&C::num_channels, 3}, {&C::num_layers, 0}})));
}

}  // namespace
}  // namespace bitr
