// The official loss and its gradient for every parameter, as defined, in double precision and reference mode,
// against the official code's.
#include <cmath>

#include "model/parameter_gradients.hpp"
#include "support/golden.hpp"
#include "train/training_graph.hpp"

namespace bitr {
namespace {

using test::GoldenCase;
using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

struct GradientCase {
  const char* name;
  int number;
  std::string file;
  friend std::ostream& operator<<(std::ostream& out, const GradientCase& c) { return out << c.name; }
};

class OfficialGradient : public testing::TestWithParam<GradientCase> {};

TEST_P(OfficialGradient, IsReproduced) {
  const auto [name, number, file] = GetParam();
  if (!std::filesystem::exists(test::golden_path(file)))
    GTEST_SKIP() << file << " is not among the committed data and ../shared/golden is absent";
  GoldenCase golden = GoldenCase::load(number, file);
  golden.weights.mode = Mode::reference;
  const train::TrainingGraph training = train::training_graph(golden.weights, ops::LossKind::official, true);
  const graph::Graph& graph = training.result.graph;

  ThreadPool pool(2);
  cpu::Executor<double> executor(graph, pool);
  const auto R = golden.values("in.R_gt"), t = golden.values("in.t_gt");
  golden.fill(executor);
  for (std::uint32_t pair = 0; pair < golden.layout().pairs(); ++pair) {
    double* truth = executor.data(graph.input(graph::Input::truth)) + pair * ops::truth_width;
    std::copy_n(R.begin() + 9 * pair, 9, truth);
    std::copy_n(t.begin() + 3 * pair, 3, truth + 9);
    std::ranges::copy(ops::no_symmetry, truth + ops::pose_numbers);
  }
  executor.run();

  const auto* loss = executor.data(graph.output(graph::Output::loss));
  double terms[ops::loss_terms] = {};
  for (std::uint32_t pair = 0; pair < golden.layout().pairs(); ++pair)
    for (double& term : terms) term += *loss++ / golden.layout().pairs();
  EXPECT_NEAR(terms[0], golden.values("loss.r")[0], 1e-9);
  EXPECT_NEAR(terms[1], golden.values("loss.t")[0], 1e-9);
  EXPECT_NEAR(terms[2], golden.values("loss.reg")[0], 1e-12);
  EXPECT_NEAR(terms[0] + terms[1] + terms[2], golden.values("loss.total")[0], 1e-9);

  std::vector<std::vector<double>> constants(training.made.nodes.size());
  for (std::size_t i = 0; i < constants.size(); ++i)
    if (const graph::TensorId id = training.result.constants[i]; id != graph::no_tensor)
      constants[i] = executor.read<double>(id);
  const auto gradients = model::parameter_gradients(golden.weights, training.whole, training.made, constants);

  std::size_t compared = 0;
  for (const auto& [parameter, gradient] : gradients) {
    const RowMajor rows = gradient;
    const std::span<const double> values(rows.data(), static_cast<std::size_t>(rows.size()));
    // A parameter that nothing reads has none.
    std::vector<double> expected(values.size());
    double tolerance = 1e-8;
    if (golden.has("grad." + parameter)) {
      const Tensor& tensor = golden.at("grad." + parameter);
      expected = tensor.to_double();
      if (tensor.type == DType::f32) tolerance = 1e-7;
      ++compared;
    }
    ASSERT_EQ(values.size(), expected.size()) << parameter;
    double worst = 0, largest = 0;
    for (std::size_t i = 0; i < expected.size(); ++i) {
      worst = std::max(worst, std::abs(values[i] - expected[i]));
      largest = std::max(largest, std::abs(expected[i]));
      EXPECT_TRUE(std::isfinite(values[i])) << parameter;
    }
    // Gradients that vanish by symmetry are rounding on both sides.
    EXPECT_LE(worst, tolerance * largest + 1e-15) << parameter;
  }
  std::size_t official = 0;
  for (const auto& [tensor, values] : golden.tensors.tensors) official += tensor.rfind("grad.", 0) == 0;
  EXPECT_EQ(compared, official);
}

// The last holds the first's inputs, loss and gradients, these in single precision.
INSTANTIATE_TEST_SUITE_P(Cases, OfficialGradient,
                         testing::Values(GradientCase{"case_01", 1, test::case_file(1)},
                                         GradientCase{"case_07", 7, test::case_file(7)},
                                         GradientCase{"case_01_single", 1, "gradient_01.safetensors"}),
                         [](const auto& c) { return c.param.name; });

}  // namespace
}  // namespace bitr
