// The network as defined, in double precision and reference mode, against every tensor the official code gave.
#include <cmath>
#include <map>

#include "cpu/radial.hpp"
#include "model/architecture.hpp"
#include "support/golden.hpp"

namespace bitr {
namespace {

using test::GoldenCase;

// A case and the network as defined, run on it once for all tests.
struct Run {
  explicit Run(int number)
      : golden(GoldenCase::load(number)),
        whole(model::build_graph(golden.weights, Mode::reference)),
        executor(model::expand(whole), true) {
    cpu::ThreadPool pool(2);
    golden.run(executor, pool);
  }
  const GoldenCase golden;
  const graph::Graph whole;
  cpu::Executor<double> executor;
};

class AsDefined : public testing::TestWithParam<int> {
 protected:
  void SetUp() override {
    if (!GoldenCase::available(GetParam()))
      GTEST_SKIP() << "case " << GetParam()
                   << " is not among the committed data and ../shared/golden is absent";
  }
  static void TearDownTestSuite() { runs_.clear(); }
  Run& run() {
    auto& run = runs_[GetParam()];
    if (!run) run = std::make_unique<Run>(GetParam());
    return *run;
  }
  // Only two cases hold what happens inside the layers.
  bool deep() { return run().golden.tensors.metadata.at("mode") == "\"deep\""; }

 private:
  inline static std::map<int, std::unique_ptr<Run>> runs_;
};

// Compares golden tensor `name` with rows of `tensor`, columns [column, column + width).
class Comparison {
 public:
  Comparison(const GoldenCase& golden, cpu::Executor<double>& executor) : golden_(golden), executor_(executor) {}

  void stage(const std::string& golden_name, const std::string& tensor, std::size_t column = 0) {
    if (!golden_.has(golden_name)) return;
    const graph::TensorId id = executor_.graph().find(tensor);
    ASSERT_NE(id, graph::no_tensor) << tensor;
    const auto& info = executor_.graph().tensors[id];
    const auto expected = golden_.values(golden_name);
    const std::size_t rows = golden_.at(golden_name).shape[0], width = expected.size() / rows;
    ASSERT_LE(column + width, static_cast<std::size_t>(info.width)) << tensor;
    // Edge tensors hold a sample of leading edges.
    const double* data = executor_.data(id);
    double worst = 0, largest = 0;
    for (std::size_t row = 0; row < rows; ++row)
      for (std::size_t c = 0; c < width; ++c) {
        const double value = data[row * info.width + column + c];
        worst = std::max(worst, std::abs(value - expected[row * width + c]));
        largest = std::max(largest, std::abs(expected[row * width + c]));
      }
    EXPECT_LE(worst, 1e-9 * largest) << golden_name << " of case " << golden_.number;
    ++compared;
  }

  void feature(const std::string& stage_name, const std::string& tensor) {
    const graph::TensorId id = executor_.graph().find(tensor);
    ASSERT_NE(id, graph::no_tensor) << tensor;
    const auto& fiber = executor_.graph().tensors[id].fiber;
    for (const auto& [d, m] : fiber)
      stage(stage_name + ".d" + std::to_string(d.p) + std::to_string(d.q), tensor, fiber.offset(d));
  }

  int compared = 0;

 private:
  const GoldenCase& golden_;
  cpu::Executor<double>& executor_;
};

TEST_P(AsDefined, ReproducesEveryStage) {
  const GoldenCase& golden = run().golden;
  cpu::Executor<double>& executor = run().executor;
  ASSERT_EQ(graph::check_executable(executor.graph()), "");
  Comparison compare(golden, executor);

  for (const auto& info : executor.graph().tensors) {
    const std::string& name = info.name;
    if (name.rfind("key.key_extract", 0) == 0) continue;  // see KeyFeatures below
    if (!info.fiber.degrees())
      compare.stage(name, name);
    else if (name == "key.pool_out" || name == "key.logit")
      compare.stage(name, name);
    else if (name != "key.pooled_feature")
      compare.feature(name, name);
  }
  // [cloud, channel, degree 0 | degree 1]
  if (golden.has("key.pooled_feature")) {
    const auto expected = golden.values("key.pooled_feature");
    const double* means = executor.data(executor.graph().find("key.pooled_feature"));
    for (std::size_t cloud = 0; cloud < golden.layout().clouds(); ++cloud)
      for (std::size_t c = 0; c < 4; ++c)
        for (std::size_t m = 0; m < 4; ++m) {
          const double value = m == 0 ? means[16 * cloud + c] : means[16 * cloud + 4 + 3 * c + m - 1];
          EXPECT_NEAR(value, expected[(cloud * 4 + c) * 4 + m], 1e-9);
        }
  }
  const auto stages = golden.tensors.metadata.at("mode");
  EXPECT_GE(compare.compared, stages == "\"deep\"" ? 100 : stages == "\"stage\"" ? 35 : 2) << stages;
}

TEST_P(AsDefined, ReproducesThePoseAndTheHead) {
  const GoldenCase& golden = run().golden;
  cpu::Executor<double>& executor = run().executor;
  const double* poses = executor.data(executor.graph().pose);
  const double* pieces = executor.data(executor.graph().find("head.pieces"));
  const auto R = golden.values("out.R"), t = golden.values("out.t"), r = golden.values("out.r_vector");
  for (std::size_t pair = 0; pair < golden.layout().pairs(); ++pair) {
    double scale_t = 0, scale_r = 0;
    for (int i = 0; i < 3; ++i) scale_t = std::max(scale_t, std::abs(t[3 * pair + i]));
    for (int i = 0; i < 9; ++i) scale_r = std::max(scale_r, std::abs(r[9 * pair + i]));
    for (int i = 0; i < 9; ++i) {
      EXPECT_NEAR(poses[16 * pair + i], R[9 * pair + i], 1e-9) << "R of case " << golden.number;
      EXPECT_NEAR(pieces[21 * pair + i], r[9 * pair + i], 1e-9 * scale_r) << "r of case " << golden.number;
    }
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(poses[16 * pair + 9 + i], t[3 * pair + i], 1e-9 * std::max(1.0, scale_t));
    if (!golden.has("head.m1m2")) continue;
    const auto means = golden.values("head.m1m2");
    for (int i = 0; i < 6; ++i) EXPECT_NEAR(pieces[21 * pair + 9 + i], means[6 * pair + i], 1e-9);
  }
}

TEST_P(AsDefined, FindsTheSameNeighbours) {
  const GoldenCase& golden = run().golden;
  cpu::Executor<double>& executor = run().executor;
  const std::pair<const char*, const char*> lists[] = {
      {"graph.edge_src", "graph.index"}, {"key.knn_x", "key.index"}, {"bi.edge_src", "bi.index"}};
  for (const auto& [golden_name, tensor] : lists) {
    if (!golden.has(golden_name)) continue;
    const auto expected = golden.values(golden_name);
    const auto* index = executor.data<std::uint32_t>(executor.graph().find(tensor));
    for (std::size_t e = 0; e < expected.size(); ++e) ASSERT_EQ(index[e], expected[e]) << golden_name << " edge " << e;
  }
}

INSTANTIATE_TEST_SUITE_P(Cases, AsDefined, testing::ValuesIn(test::all_cases));

}  // namespace
}  // namespace bitr
