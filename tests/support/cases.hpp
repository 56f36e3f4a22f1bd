// Networks and clouds at the edges of what an operation has to take.
#pragma once

#include <array>
#include <cstddef>
#include <ostream>
#include <vector>

#include "model/config.hpp"

namespace bitr::test {

struct Case {
  const char* name;
  ModelConfig config;
  std::vector<std::array<std::size_t, 2>> pairs;  ///< points of source and reference
  std::size_t duplicates = 0;                     ///< every so many points; 0: none
  friend std::ostream& operator<<(std::ostream& out, const Case& c) { return out << c.name; }
};

/// Every input there is.
inline ModelConfig normals_and_colors() {
  ModelConfig c;
  c.return_normals = c.get_color = true;
  c.key_global_merge_coe = 8;
  return c;
}

/// The least layers, neighbours and key points.
inline ModelConfig shallow_model() {
  ModelConfig c;
  c.num_layers = c.feature_num_layers = 0;
  c.k_neighbor = c.re_convert_k = c.key_mean_num = 1;
  c.num_key_points = 4;
  return c;
}

/// More neighbours and key points than a work group has lanes.
inline ModelConfig wide_model(int channels) {
  ModelConfig c;
  c.num_channels = c.feature_num_channels = channels;
  c.div = 3;
  c.num_key_points = 36;
  c.k_neighbor = 37;
  c.key_mean_num = 64;
  c.re_convert_k = 33;
  c.num_layers = c.feature_num_layers = 1;
  return c;
}

/// The options of the models that ship.
inline ModelConfig trained_model() {
  ModelConfig c;
  c.k_neighbor = 24;
  c.neighbor_dilation = 4;
  c.relu_square = c.centroid_offset = c.return_normals = true;
  return c;
}

}  // namespace bitr::test
