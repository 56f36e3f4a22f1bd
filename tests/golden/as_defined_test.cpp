// The network as defined, in double precision and reference mode, against every tensor the official code
// gave.
#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <span>

#include "cpu/radial.hpp"
#include "irreps/clebsch_gordan.hpp"
#include "irreps/harmonics.hpp"
#include "model/architecture.hpp"
#include "support/golden.hpp"

namespace bitr {
namespace {

using test::GoldenCase;

// A case and the network as defined, run on it once for all tests.
struct CaseRun {
  explicit CaseRun(int number)
      : golden(GoldenCase::load(number)),
        whole(model::build_graph(golden.weights, Mode::reference)),
        executor(model::expand(whole), pool, {.retain = true}) {
    golden.run(executor);
  }
  const GoldenCase golden;
  const graph::Graph whole;
  ThreadPool pool{2};
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
  CaseRun& run() {
    auto& run = runs_[GetParam()];
    if (!run) run = std::make_unique<CaseRun>(GetParam());
    return *run;
  }
  // Only two cases hold what happens inside the layers.
  bool deep() { return run().golden.tensors.metadata.at("mode") == "\"deep\""; }

 private:
  inline static std::map<int, std::unique_ptr<CaseRun>> runs_;
};

// K_J(d̂)[out, in] of one side, J ascending; direction in the order (y, z, x).
std::vector<Eigen::MatrixXd> kernels(int in, int out, const double* yzx) {
  const double xyz[3] = {yzx[2], yzx[0], yzx[1]};
  double harmonics[irreps::harmonic_count(2)];
  irreps::spherical_harmonics(2, xyz, harmonics);
  std::vector<Eigen::MatrixXd> all;
  for (int J = std::abs(in - out); J <= in + out; ++J) {
    const Eigen::VectorXd column = irreps::clebsch_gordan_block(in, out, J) *
                                   Eigen::Map<const Eigen::VectorXd>(harmonics + J * J, 2 * J + 1);
    // Rows of the block: in slow, out fast.
    all.push_back(Eigen::Map<const Eigen::MatrixXd>(column.data(), 2 * out + 1, 2 * in + 1));
  }
  return all;
}

// Compares golden tensor `name` with rows of `tensor`, columns [column, column + width).
class Comparison {
 public:
  Comparison(const GoldenCase& golden, cpu::Executor<double>& executor)
      : golden_(golden), executor_(executor) {}

  // Edge tensors of the official code hold a sample of leading edges; `skip`: its leading rows to leave out.
  void stage(const std::string& golden_name, const std::string& tensor, std::size_t column = 0,
             std::size_t skip = 0) {
    if (!golden_.has(golden_name)) return;
    const graph::TensorId id = executor_.graph().find(tensor);
    ASSERT_NE(id, graph::no_tensor) << tensor;
    const auto& info = executor_.graph().tensors[id];
    const auto expected = golden_.values(golden_name);
    const std::size_t rows = golden_.at(golden_name).shape[0], width = expected.size() / rows;
    ASSERT_LE(column + width, static_cast<std::size_t>(info.width)) << tensor;
    ASSERT_LE(rows - skip, executor_.layout().rows(info.rows) * info.per_row) << tensor;
    const double* data = executor_.data(id);
    std::vector<double> values;
    for (std::size_t row = 0; row < rows - skip; ++row)
      for (std::size_t c = 0; c < width; ++c) values.push_back(data[row * info.width + column + c]);
    expect_equal(golden_name, values, skip * width);
  }

  // `values` against the golden tensor's numbers from `skip` on.
  void expect_equal(const std::string& golden_name, std::span<const double> values, std::size_t skip = 0) {
    const auto expected = golden_.values(golden_name);
    ASSERT_EQ(values.size() + skip, expected.size()) << golden_name;
    double worst = 0, largest = 0;
    for (std::size_t i = 0; i < values.size(); ++i) {
      const double difference = std::abs(values[i] - expected[skip + i]);
      if (!(difference <= worst)) worst = difference;  // keeps a NaN
      largest = std::max(largest, std::abs(expected[skip + i]));
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
    if (name.rfind("key.key_extract", 0) == 0) continue;  // see ReproducesTheKeyPointsFeatures
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

// Radial networks with their tying; the official code has none for pairs of degrees that borrow the mirrored
// ones'.
TEST_P(AsDefined, ReproducesEveryRadialNetwork) {
  if (!deep()) GTEST_SKIP() << "the case holds no radial outputs";
  cpu::Executor<double>& executor = run().executor;
  Comparison compare(run().golden, executor);
  for (const graph::Node& node : run().whole.nodes) {
    const auto* layer = std::get_if<ops::AttentionLayer>(&node.op);
    if (!layer) continue;
    const std::string index = run().whole.tensors[node.inputs[1]].name;
    const double* lengths = executor.data(executor.graph().find(index.substr(0, index.find('.')) + ".r"));
    for (const auto& [part, convolve] : {std::pair(".vk", &layer->values_keys),
                                         std::pair(".v", &layer->values), std::pair(".k", &layer->keys)})
      for (const ops::RadialBlock& block : convolve->blocks) {
        const std::string name = node.name + part + ".rp.(" + block.in.str() + "," + block.out.str() + ")";
        ASSERT_EQ(run().golden.has(name), block.tying != ops::Tying::mirrored) << name;
        if (!run().golden.has(name)) continue;
        const auto edges = static_cast<Eigen::Index>(run().golden.at(name).shape[0]);
        const Eigen::MatrixXd values =
            cpu::evaluate_block<double>(block, cpu::Radial<double>(*block.network),
                                        Eigen::Map<const Eigen::MatrixXd>(lengths, layer->sides, edges));
        compare.expect_equal(name, {values.data(), static_cast<std::size_t>(values.size())});
      }
  }
  EXPECT_EQ(compare.compared, run().golden.weights.config.return_normals ? 60 : 58);
}

// K_J of every pair of degrees from Clebsch–Gordan matrices and harmonics, and the lengths they go with.
TEST_P(AsDefined, ReproducesEveryKernel) {
  if (!deep()) GTEST_SKIP() << "the case holds no kernels";
  cpu::Executor<double>& executor = run().executor;
  Comparison compare(run().golden, executor);
  const std::string degrees[] = {"(0, 0)", "(0, 1)", "(1, 0)", "(1, 1)"};
  for (const auto& [graph, sides] : {std::pair("graph", 1), std::pair("bi", 2)}) {
    compare.stage(std::string(graph) + ".r", std::string(graph) + ".r");
    const double* directions = executor.data(executor.graph().find(std::string(graph) + ".direction"));
    for (int in = 0; in < 4; ++in)
      for (int out = 0; out < 4; ++out) {
        const std::string name = std::string(graph) + ".basis_(" + degrees[in] + "," + degrees[out] + ")";
        if (!run().golden.has(name)) continue;
        const irreps::Degree i{in / 2, in % 2}, o{out / 2, out % 2};
        std::vector<double> values;
        for (std::size_t e = 0; e < run().golden.at(name).shape[0]; ++e) {
          const auto first = kernels(i.p, o.p, directions + 3 * sides * e);
          const auto second = sides == 2 ? kernels(i.q, o.q, directions + 6 * e + 3)
                                         : std::vector<Eigen::MatrixXd>{Eigen::MatrixXd::Ones(1, 1)};
          for (int row = 0; row < o.dim(); ++row)
            for (int column = 0; column < i.dim(); ++column)
              for (const auto& a : first)
                for (const auto& b : second)
                  values.push_back(a(row / b.rows(), column / b.cols()) *
                                   b(row % b.rows(), column % b.cols()));
        }
        compare.expect_equal(name, values);
      }
  }
  EXPECT_EQ(compare.compared, 2 + 4 + 16);
}

// The official graph of key features lists the points its edges use, then the key points; ours has key points
// only.
TEST_P(AsDefined, ReproducesTheKeyPointsFeatures) {
  if (!deep()) GTEST_SKIP() << "the case holds nothing inside the layer";
  Comparison compare(run().golden, run().executor);
  const std::string name = "key.key_extract";
  const std::size_t keys = run().executor.layout().rows(graph::Rows::key);
  const std::size_t points = run().golden.at(name + ".q.d00").shape[0] - keys;
  for (const auto& [degree, column] : {std::pair(".d00", 0), std::pair(".d10", 4)})
    compare.stage(name + ".vk" + degree, name + ".vk", column);
  for (const auto& [degree, column] : {std::pair(".d00", 0), std::pair(".d10", 2)})
    compare.stage(name + ".attn_out" + degree, name + ".attn_out", column, points);
  compare.stage(name + ".attn", name + ".attn");
  EXPECT_EQ(compare.compared, 5);
  // Zero features of the centres: zero queries, uniform attention, logits of zero.
  for (const char* what : {".q.d00", ".q.d10"}) {
    const auto queries = run().golden.values(name + what);
    const std::size_t width = queries.size() / (points + keys);
    for (std::size_t i = points * width; i < queries.size(); ++i) EXPECT_EQ(queries[i], 0);
  }
  const auto& executor = run().executor;
  const double* logits = executor.data(executor.graph().find(name + ".attn_logit"));
  for (const double expected : run().golden.values(name + ".attn_logit")) {
    EXPECT_EQ(expected, 0);
    EXPECT_EQ(*logits++, 0);
  }
}

// The head's sums, which no tensor of the graph holds: from its weights and features, then mixed to what it
// returns.
TEST_P(AsDefined, ReproducesTheSumsOfTheHead) {
  if (!run().golden.has("head.pooled.d11")) GTEST_SKIP() << "the case holds no sums of the head";
  const cpu::Executor<double>& executor = run().executor;
  Comparison compare(run().golden, run().executor);
  const auto node =
      std::find_if(run().whole.nodes.begin(), run().whole.nodes.end(),
                   [](const graph::Node& n) { return std::holds_alternative<ops::Head>(n.op); });
  const auto& head = std::get<ops::Head>(node->op);
  const double* features = executor.data(executor.graph().find(run().whole.tensors[node->inputs[1]].name));
  const double* weights = executor.data(executor.graph().find("head.weights"));
  const double* pieces = executor.data(executor.graph().find("head.pieces"));
  const auto keys = executor.layout().key_points;
  const auto pairs = executor.layout().pairs();
  constexpr int to_xyz[] = {2, 0, 1};

  std::map<std::string, std::vector<double>> pooled, mixed;
  std::vector<double> ab;
  for (std::uint32_t pair = 0; pair < pairs; ++pair)
    for (const auto& [d, channels] : head.fiber) {
      if (d == irreps::Degree{0, 0}) continue;
      const int column = d == irreps::Degree{1, 1} ? 0 : 1;
      const std::string name = ".d" + std::to_string(d.p) + std::to_string(d.q);
      Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(channels, d.dim());
      for (std::uint32_t key = 0; key < keys; ++key)
        for (int c = 0; c < channels; ++c)
          for (int m = 0; m < d.dim(); ++m)
            sum(c, m) +=
                weights[(pair * keys + key) * 3 + column] *
                features[(pair * keys + key) * head.fiber.size() + head.fiber.offset(d) + c * d.dim() + m];
      for (int c = 0; c < channels; ++c)
        for (int m = 0; m < d.dim(); ++m) pooled[name].push_back(sum(c, m));
      const Eigen::RowVectorXd lin = (column == 0 ? head.matrix_mix : head.vector_mix) * sum;
      mixed[name].insert(mixed[name].end(), lin.begin(), lin.end());
      // What the head returned, back in the features' order.
      const double* piece = pieces + ops::piece_count * pair;
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
          if (d == irreps::Degree{1, 1})
            EXPECT_NEAR(piece[3 * i + j], lin[3 * to_xyz[i] + to_xyz[j]], 1e-12 * lin.norm());
          else
            EXPECT_NEAR(piece[(d.p ? 15 : 18) + i], lin[to_xyz[i]], 1e-12 * lin.norm());
    }
  for (const auto& [name, values] : pooled) compare.expect_equal("head.pooled" + name, values);
  for (const auto& [name, values] : mixed) compare.expect_equal("head.lin" + name, values);
  compare.expect_equal("head.mean_r", pooled.at(".d11"));
  for (std::size_t row = 0; row < pooled.at(".d10").size(); row += 3)
    for (const char* name : {".d10", ".d01"})
      ab.insert(ab.end(), pooled.at(name).begin() + row, pooled.at(name).begin() + row + 3);
  compare.expect_equal("head.mean_ab", ab);
  EXPECT_EQ(compare.compared, 8);
}

TEST_P(AsDefined, ReproducesThePoseAndTheHead) {
  const GoldenCase& golden = run().golden;
  cpu::Executor<double>& executor = run().executor;
  const double* poses = executor.data(executor.graph().output(graph::Output::pose));
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
    for (int i = 0; i < 3; ++i)
      EXPECT_NEAR(poses[16 * pair + 9 + i], t[3 * pair + i], 1e-9 * std::max(1.0, scale_t));
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
    for (std::size_t e = 0; e < expected.size(); ++e)
      ASSERT_EQ(index[e], expected[e]) << golden_name << " edge " << e;
  }
}

INSTANTIATE_TEST_SUITE_P(Cases, AsDefined, testing::ValuesIn(test::all_cases));

}  // namespace
}  // namespace bitr
