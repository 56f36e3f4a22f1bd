// Two-sided layers: ops/pair_attention.hpp.
#include <cmath>

#include "model/fold_layers.hpp"

namespace bitr::model {
namespace {

using Eigen::MatrixXd;
using irreps::Degree;

// Per side: coefficients of the edge's own frame (rows) from those of J (columns).
MatrixXd frame_basis(int in, int out) {
  if (in == 0 || out == 0) return MatrixXd::Ones(1, 1);
  MatrixXd basis(3, 3);
  const double third = 1 / std::sqrt(3.0), half = 1 / std::sqrt(2.0), sixth = 1 / std::sqrt(6.0);
  basis << -third, 0, 2 * sixth,  //
      -third, 0, -sixth,          //
      0, half, 0;
  return basis;
}

// The same for both sides; `exchanged`: columns in the order (J₂, J₁) of the mirrored pair's network.
MatrixXd pair_basis(const ops::RadialBlock& block, bool exchanged) {
  const MatrixXd first = frame_basis(block.in.p, block.out.p), second = frame_basis(block.in.q, block.out.q);
  const auto a = first.cols(), b = second.cols();
  MatrixXd basis(a * b, a * b);
  for (Eigen::Index i = 0; i < a; ++i)
    for (Eigen::Index j = 0; j < b; ++j)
      for (Eigen::Index row = 0; row < a * b; ++row)
        basis(row, exchanged ? j * a + i : i * b + j) = first(row / b, i) * second(row % b, j);
  return basis;
}

// One sector table to be made.
struct TableJob {
  const ops::RadialBlock* radial;
  bool swapped;
  double scale;
  int begin;

  ops::SectorTable make() const {
    ops::SectorTable table = sector_table(radial->network, pair_basis(*radial, swapped), radial->in_channels,
                                          radial->out_channels, scale);
    table.swapped = swapped;
    table.begin = begin;
    return table;
  }
};

void add_block(ops::PairAttention& op, const ops::RadialBlock& radial, int out_begin,
               std::vector<TableJob>& jobs) {
  const ops::PairBlock block{radial.in,           radial.out, radial.in_channels,
                             radial.out_channels, out_begin,  op.coefficient_count};
  const auto add = [&](bool swapped, double scale) {
    jobs.push_back({&radial, swapped, scale, block.coefficients});
  };
  switch (radial.tying) {
    case ops::Tying::direct:
      add(false, 1);
      break;
    case ops::Tying::mirrored:
      add(true, 1);
      break;
    case ops::Tying::symmetrised:
      add(false, 0.5);
      add(true, 0.5);
      break;
  }
  op.coefficient_count += block.freq() * block.in_channels * block.out_channels;
  op.blocks.push_back(block);
}

}  // namespace

ops::PairAttention pair_attention(const ops::AttentionLayer& layer, const ops::ProjectedRelu* relu,
                                  const ForEach& for_each) {
  ops::PairAttention op{.heads = layer.heads,
                        .fiber_in = layer.fiber_in,
                        .fiber_out = layer.fiber_out,
                        .value_fiber = layer.value_fiber,
                        .key_fiber = layer.key_fiber,
                        .blocks = {},
                        .tables = {},
                        .query = {},
                        .project = {},
                        .self = {},
                        .planes = {}};
  std::vector<TableJob> jobs;
  for (const auto& block : layer.values_keys.blocks) add_block(op, block, 0, jobs);
  for (const auto& block : layer.values.blocks) add_block(op, block, 0, jobs);
  for (const auto& block : layer.keys.blocks)
    add_block(op, block, layer.value_fiber.channels(block.out), jobs);
  op.tables.resize(jobs.size());
  for_each(jobs.size(), [&](std::size_t i) { op.tables[i] = jobs[i].make(); });

  const double logit_scale = 1 / std::sqrt(layer.key_fiber.component_count());
  for (const auto& [d, m] : layer.key_fiber) op.query[d] = with_skip(layer.query, d) * logit_scale;
  for (const auto& [d, m] : layer.fiber_out) {
    const MatrixXd project = with_skip(layer.project, d);
    const int values = layer.value_fiber.channels(d);
    op.project[d] = project.leftCols(values);
    if (project.cols() > values) op.self[d] = project.rightCols(project.cols() - values);
  }
  if (relu) {
    op.relu = true;
    op.planes = relu->planes;
    op.relu_square = relu->square;
  }
  return op;
}

}  // namespace bitr::model
