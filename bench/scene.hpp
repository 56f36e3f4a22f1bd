// A batch of pairs, and every tensor of the network on it.
#pragma once

#include <numeric>
#include <vector>

#include "api/executor.hpp"
#include "api/pack.hpp"
#include "bench.hpp"

namespace bitr::bench {

class Scene {
 public:
  Scene(const graph::Graph& graph, const ModelConfig& config, Size size)
      : graph_(graph), size_(size), pairs_(make_pairs(size)) {
    for (const GeneratedPair& pair : pairs_) views_.push_back({pair.source, pair.reference});
    batch_ = pack(config, Precision::f32, shape_of(views_), views_).value();
    // In the order of the generator, as every recorded time has it.
    for (std::vector<std::uint32_t>& order : batch_.order) std::iota(order.begin(), order.end(), 0U);
  }
  Scene(const Scene&) = delete;  // the batch looks at the pairs
  Scene& operator=(const Scene&) = delete;

  const graph::BatchLayout& layout() const { return batch_.layout; }
  bool is_of(const graph::Graph& graph, Size size) const {
    return &graph == &graph_ && size.points == size_.points && size.pairs == size_.pairs;
  }

  std::vector<float> real(graph::TensorId id) { return copy<float>(id); }
  std::vector<std::uint32_t> indices(graph::TensorId id) { return copy<std::uint32_t>(id); }

 private:
  template <class T>
  std::vector<T> copy(graph::TensorId id) {
    if (!network_) {
      network_ = make_executor(cpu_, graph_, layout(), {.retain = true});
      network_->prepare(layout());
      fill_inputs(batch_, *network_);
    }
    // Inputs alone need no run.
    if (!ran_ && !graph_.inputs.holds(id)) {
      network_->run();
      ran_ = true;
    }
    return network_->read<T>(id);
  }

  const graph::Graph& graph_;
  const Size size_;
  std::vector<GeneratedPair> pairs_;
  std::vector<CloudPair> views_;  // into pairs_
  PackedBatch batch_;             // into views_
  const Device cpu_ = cpu_device();
  std::unique_ptr<graph::Executor> network_;  // once a tensor is asked for
  bool ran_ = false;
};

}  // namespace bitr::bench
