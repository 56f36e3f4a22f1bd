// Random configurations and weights that nothing trained: every size, switch and norm takes part.
#pragma once

#include <algorithm>
#include <vector>

#include "core/random.hpp"
#include "model/config.hpp"
#include "model/load.hpp"

namespace bitr::test {

/// Valid configurations with channels, heads, layers, key points and neighbour counts up to `largest_k`.
inline std::vector<ModelConfig> random_configurations(std::uint64_t seed, std::size_t count,
                                                      int largest_k = 64) {
  Random random(seed);
  const auto from = [&](int low, int high) { return low + static_cast<int>(random.below(high - low + 1)); };
  std::vector<ModelConfig> configurations;
  while (configurations.size() < count) {
    ModelConfig c;
    c.heads = from(1, 3);
    c.div = from(1, 3);
    const int unit = c.heads * c.div;
    c.num_channels = unit * from(1, std::max(1, 8 / unit));
    c.feature_num_channels = unit * from(1, std::max(1, 8 / unit));
    c.predict_head = from(1, 3);
    c.num_layers = from(0, 3);
    c.feature_num_layers = from(0, 3);
    c.num_key_points = unit * from(std::max(1, 3 / unit), 36 / unit);
    c.re_convert_k = from(1, std::max(1, c.num_key_points - 1));
    c.k_neighbor = from(1, largest_k);
    c.key_mean_num = from(1, largest_k);
    c.key_global_merge_coe = from(1, 9);
    c.return_normals = from(0, 1) == 1;
    c.get_color = from(0, 2) == 0;
    if (validate(c)) configurations.push_back(c);
  }
  return configurations;
}

/// Untrained weights with every norm's gain and bias moved by `spread`, so that none is trivially 1 or 0.
inline model::Weights perturbed_weights(const ModelConfig& config, std::uint64_t seed, double spread = 0.2) {
  model::Weights weights = model::initial_weights(config, seed, Mode::scale_exact);
  Random random(seed + 12345);
  for (auto& [name, matrix] : weights.parameters)
    if (name.find("normalization") != std::string::npos)
      for (double& x : matrix.reshaped()) x += spread * random.normal();
  return weights;
}

}  // namespace bitr::test
