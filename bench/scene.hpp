// A batch of pairs, and every tensor of the network on it.
#pragma once

#include <algorithm>
#include <optional>
#include <vector>

#include "bench.hpp"
#include "cpu/executor.hpp"

namespace bitr::bench {

class Scene {
 public:
  Scene(const graph::Graph& graph, std::uint32_t key_points, Size size)
      : graph_(graph), size_(size), pairs_(make_pairs(size)) {
    layout_ = graph::BatchLayout(std::vector(2 * size.pairs, size.points), key_points);
  }
  const graph::BatchLayout& layout() const { return layout_; }
  bool is_of(const graph::Graph& graph, Size size) const {
    return &graph == &graph_ && size.points == size_.points && size.pairs == size_.pairs;
  }

  std::vector<float> real(graph::TensorId id) {
    if (id == graph_.positions) return rows(&PointCloud::positions);
    if (id == graph_.normals) return rows(&PointCloud::normals);
    return copy<float>(id);
  }
  std::vector<std::uint32_t> indices(graph::TensorId id) { return copy<std::uint32_t>(id); }

 private:
  std::vector<float> rows(auto PointCloud::*member) const {
    std::vector<float> numbers;
    for (const auto side : {&GeneratedPair::source, &GeneratedPair::reference})
      for (const GeneratedPair& pair : pairs_)
        for (const auto& row : pair.*side.*member)
          for (const auto x : row) numbers.push_back(static_cast<float>(x));
    return numbers;
  }
  template <class T>
  std::vector<T> copy(graph::TensorId id) {
    if (!network_) {
      network_.emplace(graph_, true);
      network_->prepare(layout_);
      for (const graph::TensorId input : {graph_.positions, graph_.normals})
        if (input != graph::no_tensor) std::ranges::copy(real(input), network_->data(input));
      ThreadPool pool;
      network_->run(pool);
    }
    const graph::TensorInfo& info = graph_.tensors[id];
    const T* data = network_->data<T>(id);
    return {data, data + layout_.rows(info.rows) * info.per_row * info.width};
  }

  const graph::Graph& graph_;
  const Size size_;
  std::vector<GeneratedPair> pairs_;
  graph::BatchLayout layout_;
  std::optional<cpu::Executor<float>> network_;  // once a tensor is asked for that it has to make
};

}  // namespace bitr::bench
