// A widened network's function is the narrower one's.
#include "model/widen.hpp"

#include <gmock/gmock.h>

#include <bitr/bitr.hpp>

#include "api/internal.hpp"
#include "model/load.hpp"
#include "support/configurations.hpp"
#include "support/shapes.hpp"

namespace bitr {
namespace {

struct Case {
  const char* name;
  ModelConfig narrow;
  int channels, feature_channels, head;
  friend std::ostream& operator<<(std::ostream& out, const Case& c) { return out << c.name; }
};

ModelConfig trained() {
  ModelConfig config;
  config.return_normals = config.relu_square = config.centroid_offset = true;
  return config;
}

std::vector<Case> cases() {
  ModelConfig shallow;
  shallow.num_layers = shallow.feature_num_layers = 0;
  shallow.div = shallow.heads = 1;
  shallow.feature_num_channels = 3;
  // Five channels are as many as the pooled scalars: there a layer's input is added, in the wide model only.
  ModelConfig even = trained();
  even.div = even.heads = 1;
  even.feature_num_channels = 4;
  even.num_channels = 3;
  return {{"both", trained(), 8, 12, 3},       {"features_only", trained(), 4, 8, 2},
          {"pairs_only", {}, 8, 4, 2},         {"head_only", {}, 4, 4, 5},
          {"shallow", shallow, 4, 6, 2},       {"nothing", trained(), 4, 4, 2},
          {"as_many_as_pooled", even, 5, 5, 2}};
}

class Widen : public testing::TestWithParam<Case> {
 protected:
  void SetUp() override {
    const Case& c = GetParam();
    narrow_ = test::perturbed_weights(c.narrow, 1);
    ModelConfig config = c.narrow;
    config.num_channels = c.channels;
    config.feature_num_channels = c.feature_channels;
    config.predict_head = c.head;
    auto wide = model::widen(narrow_, test::perturbed_weights(config, 2));
    ASSERT_TRUE(wide) << wide.error().message;
    wide_ = std::move(*wide);
  }

  static Assembly solve(const model::Weights& weights, bool as_defined) {
    const Model model = Internal::model(std::make_shared<const model::Weights>(weights));
    Random random(3);
    const auto source = test::exact_cloud(random, 90), reference = test::exact_cloud(random, 120);
    const std::vector<CloudPair> pairs = {{source.view(), reference.view()}};
    auto plan = make_plan(cpu_device(2), model, shape_of(pairs),
                          {.precision = Precision::f64, .as_defined = as_defined});
    EXPECT_TRUE(plan) << (plan ? "" : plan.error().message);
    auto found = assemble(*plan, pairs, {.diagnostics = false});
    EXPECT_TRUE(found) << (found ? "" : found.error().message);
    return found->front();
  }

  model::Weights narrow_, wide_;
};

TEST_P(Widen, SaysTheSame) {
  for (const bool as_defined : {true, false}) {
    const Assembly narrow = solve(narrow_, as_defined), wide = solve(wide_, as_defined);
    for (int i = 0; i < 9; ++i)
      EXPECT_NEAR(wide.T_reference_source.rotation[i], narrow.T_reference_source.rotation[i], 1e-9)
          << as_defined;
    for (int i = 0; i < 3; ++i)
      EXPECT_NEAR(wide.T_reference_source.translation[i], narrow.T_reference_source.translation[i], 1e-9)
          << as_defined;
  }
}

INSTANTIATE_TEST_SUITE_P(Cases, Widen, testing::ValuesIn(cases()),
                         [](const auto& c) { return c.param.name; });

TEST(WidenTest, RefusesWhatIsNotWider) {
  const auto error = [](const ModelConfig& narrow, const ModelConfig& wide) {
    const auto widened = model::widen(model::initial_weights(narrow, 1, Mode::scale_exact),
                                      model::initial_weights(wide, 2, Mode::scale_exact));
    return widened ? "none" : widened.error().message;
  };
  ModelConfig wide;
  wide.feature_num_channels = 8;
  EXPECT_EQ(error(wide, {}), "feature_num_channels is 4, must be at least the narrower model's 8");
  wide.num_key_points = 64;
  EXPECT_THAT(error({}, wide), testing::HasSubstr("differ in more than"));
}

}  // namespace
}  // namespace bitr
