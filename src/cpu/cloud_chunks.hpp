// Clouds cut into fixed pieces of rows: partial results are combined in order, whoever computed them.
#pragma once

#include <algorithm>
#include <vector>

#include "cpu/kernel.hpp"

namespace bitr::cpu {

constexpr std::size_t chunk_rows = 1024;

struct CloudChunk {
  std::uint32_t cloud;
  std::size_t begin, end;  // point rows
};

inline std::vector<CloudChunk> cloud_chunks(const graph::BatchLayout& layout) {
  std::vector<CloudChunk> chunks;
  for (std::uint32_t cloud = 0; cloud < layout.clouds(); ++cloud)
    for (std::size_t begin = layout.cloud_offset[cloud]; begin < layout.cloud_offset[cloud + 1];
         begin += chunk_rows)
      chunks.push_back(
          {cloud, begin, std::min<std::size_t>(begin + chunk_rows, layout.cloud_offset[cloud + 1])});
  return chunks;
}

}  // namespace bitr::cpu
