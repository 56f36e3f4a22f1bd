// Two-sided layers: fold_pairs.cpp backwards.
#include <cmath>

#include "model/fold_gradient.hpp"
#include "ops/constants.hpp"

namespace bitr::model {

void add_pair_attention_gradient(const ops::AttentionLayer& layer, const ops::PairAttention& folded,
                                 const ops::PairAttention& gradient, ops::AttentionLayer& to,
                                 const ForEach& for_each) {
  // The networks of the tables, in the order in which pair_attention() makes those.
  std::vector<const ops::RadialBlock*> blocks;
  for (const ops::Convolve* convolve : {&to.values_keys, &to.values, &to.keys})
    for (const ops::RadialBlock& block : convolve->blocks)
      blocks.insert(blocks.end(), block.tying == ops::Tying::symmetrised ? 2 : 1, &block);
  std::vector<ops::RadialNetwork> parts(blocks.size());
  for_each(blocks.size(), [&](std::size_t i) {
    parts[i] = ops::zeros_like(*blocks[i]->network);
    add_sector_table_gradient(folded.tables[i], gradient.tables[i],
                              blocks[i]->in_channels * blocks[i]->out_channels, parts[i]);
  });
  for (std::size_t i = 0; i < blocks.size(); ++i)
    ops::add_constants(const_cast<ops::RadialNetwork&>(*blocks[i]->network), parts[i]);

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
