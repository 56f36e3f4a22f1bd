// Two-sided layers: fold_pairs.cpp backwards.
#include <cmath>

#include "model/fold_gradient.hpp"

namespace bitr::model {
namespace {

// A network's tables in the order in which pair_attention() makes them.
void add_block(const ops::RadialBlock& block, const ops::PairAttention& folded,
               const ops::PairAttention& gradient, std::size_t& table, ops::RadialBlock& to) {
  auto& network = const_cast<ops::RadialNetwork&>(*to.network);
  const int count = block.tying == ops::Tying::symmetrised ? 2 : 1;
  for (int i = 0; i < count; ++i, ++table)
    add_sector_table_gradient(folded.tables[table], gradient.tables[table],
                              block.in_channels * block.out_channels, network);
}

}  // namespace

void add_pair_attention_gradient(const ops::AttentionLayer& layer, const ops::PairAttention& folded,
                                 const ops::PairAttention& gradient, ops::AttentionLayer& to) {
  std::size_t table = 0;
  const auto add_blocks = [&](const ops::Convolve& from, ops::Convolve& into) {
    for (std::size_t b = 0; b < from.blocks.size(); ++b)
      add_block(from.blocks[b], folded, gradient, table, into.blocks[b]);
  };
  add_blocks(layer.values_keys, to.values_keys);
  add_blocks(layer.values, to.values);
  add_blocks(layer.keys, to.keys);

  const double logit_scale = 1 / std::sqrt(layer.key_fiber.component_count());
  for (const auto& [d, matrix] : gradient.query) to.query.weights.at(d) += logit_scale * matrix;
  for (const auto& [d, matrix] : gradient.project) {
    Eigen::MatrixXd& project = to.project.weights.at(d);
    project.leftCols(matrix.cols()) += matrix;
    if (const auto self = gradient.self.find(d); self != gradient.self.end())
      project.rightCols(self->second.cols()) += self->second;
  }
}

}  // namespace bitr::model
