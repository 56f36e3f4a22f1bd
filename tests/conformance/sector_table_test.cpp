// Sector tables against the networks they replace: every tying, both scale degrees, on and beside the rays
// between sectors, along the axes and at the origin.
#include "cpu/sector_table.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "model/build.hpp"
#include "model/fold_layers.hpp"
#include "support/configurations.hpp"

namespace bitr {
namespace {

using Eigen::MatrixXd;

// One side's coefficients in the edge's frame (axis; identity and 𝒥 across it) from those of J, on v = (1, 0,
// 0): K₀ = −1/√3, K₁ = [v]×/√2, K₂ = (3vvᵀ − 1)/√6.
MatrixXd side_basis(int in, int out) {
  if (in == 0 || out == 0) return MatrixXd::Ones(1, 1);
  MatrixXd basis = MatrixXd::Zero(3, 3);
  basis.col(0) << -1 / std::sqrt(3.0), -1 / std::sqrt(3.0), 0;
  basis.col(1) << 0, 0, 1 / std::sqrt(2.0);
  basis.col(2) << 2 / std::sqrt(6.0), -1 / std::sqrt(6.0), 0;
  return basis;
}

MatrixXd kronecker(const MatrixXd& a, const MatrixXd& b) {
  MatrixXd product(a.rows() * b.rows(), a.cols() * b.cols());
  for (Eigen::Index i = 0; i < a.rows(); ++i)
    for (Eigen::Index j = 0; j < a.cols(); ++j)
      product.block(i * b.rows(), j * b.cols(), b.rows(), b.cols()) = a(i, j) * b;
  return product;
}

struct Layer {
  ops::PairAttention op;
  std::vector<ops::RadialBlock> blocks;  // in the order of op.blocks
  std::vector<cpu::Sectors<double>> sectors;

  explicit Layer(const ops::AttentionLayer& layer) : op(model::pair_attention(layer, nullptr)) {
    for (const auto* convolve : {&layer.values_keys, &layer.values, &layer.keys})
      blocks.insert(blocks.end(), convolve->blocks.begin(), convolve->blocks.end());
    for (const auto& table : op.tables) sectors.emplace_back(table);
  }

  Eigen::VectorXd from_tables(double r1, double r2) const {
    Eigen::VectorXd all = Eigen::VectorXd::Zero(op.coefficient_count);
    for (const auto& table : sectors) table.add(r1, r2, all.data());
    return all;
  }
  Eigen::VectorXd from_networks(double r1, double r2) const {
    Eigen::VectorXd all = Eigen::VectorXd::Zero(op.coefficient_count);
    for (std::size_t b = 0; b < blocks.size(); ++b) {
      const ops::RadialBlock& block = blocks[b];
      const MatrixXd raw = cpu::evaluate_block<double>(block, cpu::Radial<double>(*block.network),
                                                       MatrixXd(Eigen::Vector2d(r1, r2)));
      const MatrixXd basis =
          kronecker(side_basis(block.in.p, block.out.p), side_basis(block.in.q, block.out.q));
      const int channels = block.in_channels * block.out_channels;
      for (int f = 0; f < block.freq(); ++f)
        for (int c = 0; c < channels; ++c)
          all[op.blocks[b].coefficients + f * channels + c] =
              basis.row(f).dot(raw.col(0).segment(c * block.freq(), block.freq()));
    }
    return all;
  }
  // Per block, relative to its largest coefficient.
  double difference(double r1, double r2) const {
    const Eigen::VectorXd a = from_tables(r1, r2), b = from_networks(r1, r2);
    double worst = 0;
    for (const auto& block : op.blocks) {
      const int size = block.freq() * block.in_channels * block.out_channels;
      const auto expected = b.segment(block.coefficients, size);
      const double error = (a.segment(block.coefficients, size) - expected).cwiseAbs().maxCoeff();
      const double largest = expected.cwiseAbs().maxCoeff();
      if (!(error <= 0)) worst = std::max(worst, error / std::max(largest, 1e-300));
    }
    return worst;
  }
};

std::vector<Layer> layers(int seed, Mode mode, double perturbation = 0.5) {
  ModelConfig config;
  config.num_layers = 1;
  const auto graph = model::build_graph(test::perturbed_weights(config, seed, perturbation), mode);
  std::vector<Layer> found;
  for (const auto& node : graph.nodes)
    if (const auto* layer = std::get_if<ops::AttentionLayer>(&node.op); layer && layer->sides == 2)
      found.emplace_back(*layer);
  EXPECT_EQ(found.size(), 2u);
  EXPECT_EQ(found.back().op.tables.back().scale_degree, 0);
  EXPECT_EQ(found.back().op.tables.front().scale_degree, 1);
  return found;
}

class SectorTable : public testing::TestWithParam<int> {
 protected:
  void expect_equal(const Layer& layer, double r1, double r2, double bound = 1e-12) {
    const double difference = layer.difference(r1, r2);
    worst_ = std::max(worst_, difference);
    EXPECT_LE(difference, bound) << r1 << ", " << r2;
  }
  ~SectorTable() override { RecordProperty("worst", std::to_string(worst_ * 1e15) + "e-15"); }
  double worst_ = 0;
  Random random_{static_cast<std::uint64_t>(GetParam())};
};

TEST_P(SectorTable, EqualsTheNetworkAtAnyLengthWithoutEps) {
  for (const Layer& layer : layers(GetParam(), Mode::scale_exact))
    for (int i = 0; i < 400; ++i) {
      const double angle = random_.uniform(0, std::numbers::pi / 2), r = std::pow(10, random_.uniform(-6, 6));
      expect_equal(layer, r * std::cos(angle), r * std::sin(angle));
    }
}

// Biases of exactly or nearly 0, as new models have them: what the sectors divide at then only touches 0 when
// it is squared.
TEST_P(SectorTable, EqualsTheNetworkWithHardlyAnyBias) {
  for (const double perturbation : {0.0, 1e-12, 1e-8, 1e-6, 1e-4})
    for (const Layer& layer : layers(GetParam(), Mode::scale_exact, perturbation))
      for (int i = 0; i < 400; ++i) {
        const double angle = random_.uniform(0, std::numbers::pi / 2);
        expect_equal(layer, std::cos(angle), std::sin(angle));
      }
}

TEST_P(SectorTable, EqualsTheNetworkOnAndBesideTheRays) {
  for (const Layer& layer : layers(GetParam(), Mode::scale_exact))
    for (const ops::SectorTable& table : layer.op.tables)
      for (const auto& [c, s] : table.rays)
        for (const double r : {0.3, 1.0})
          for (const double turn : {0.0, 1e-15, -1e-15, 1e-9, -1e-9}) {
            const double x = r * (c - turn * s), y = r * (s + turn * c);
            table.swapped ? expect_equal(layer, y, x) : expect_equal(layer, x, y);
          }
}

TEST_P(SectorTable, EqualsTheNetworkOnTheAxesAndAtTheOrigin) {
  for (const Mode mode : {Mode::scale_exact, Mode::reference})
    for (const Layer& layer : layers(GetParam(), mode)) {
      for (const double r : {0.05, 1.0, 40.0}) {
        expect_equal(layer, r, 0);
        expect_equal(layer, 0, r);
      }
      expect_equal(layer, 0, 0);
      EXPECT_TRUE(layer.from_tables(0, 0).allFinite());
    }
}

// With eps the sectors' ends shift by up to eps/2q < 5e-5 of their norm's input, where the table's slopes are
// taken from the side that eps = 0 gives: 1e-4 there, rounding elsewhere.
TEST_P(SectorTable, EqualsTheNetworkAboveTheEps) {
  int exact = 0, all = 0;
  for (const Layer& layer : layers(GetParam(), Mode::reference))
    for (int i = 0; i < 400; ++i, ++all) {
      const double angle = random_.uniform(0, std::numbers::pi / 2),
                   r = 0.05 * std::pow(10, random_.uniform(0, 4));
      const double difference = layer.difference(r * std::cos(angle), r * std::sin(angle));
      EXPECT_LE(difference, 1e-4) << r << " at " << angle;
      exact += difference <= 1e-12;
    }
  EXPECT_GE(exact, 0.98 * all);
}

TEST_P(SectorTable, BelowTheEpsTheNetworkAnswers) {
  for (const Layer& layer : layers(GetParam(), Mode::reference))
    for (const double r : {1e-9, 1e-5, 1e-4}) expect_equal(layer, 0.6 * r, 0.8 * r);
}

INSTANTIATE_TEST_SUITE_P(Networks, SectorTable, testing::Range(0, 5));

}  // namespace
}  // namespace bitr
