#include "api/runner.hpp"
#include "cpu/executor.hpp"

namespace bitr {
namespace {

template <class T>
class CpuRunner : public Runner {
 public:
  CpuRunner(graph::Graph graph, bool retain) : executor_(std::move(graph), retain) {}

  void run(const PackedBatch& batch, ThreadPool& pool) override {
    executor_.prepare(batch.layout);
    fill_inputs(batch, executor_.graph(), 3, [&](graph::TensorId id) { return executor_.data(id); });
    executor_.run(pool);
  }
  std::vector<double> tensor(graph::TensorId id) const override {
    const T* data = executor_.data(id);
    return {data, data + size(id)};
  }
  std::vector<std::uint32_t> indices(graph::TensorId id) const override {
    const auto* data = executor_.template data<std::uint32_t>(id);
    return {data, data + size(id)};
  }
  const graph::Graph& graph() const override { return executor_.graph(); }
  std::size_t workspace_bytes() const override { return executor_.workspace_bytes(); }
  std::vector<double> node_milliseconds() const override { return executor_.node_milliseconds(); }
  std::vector<double> node_starts() const override {
    // One operation begins where the one before it ends.
    std::vector<double> starts;
    double at = 0;
    for (const double milliseconds : executor_.node_milliseconds()) {
      starts.push_back(at);
      at += milliseconds;
    }
    return starts;
  }

 private:
  std::size_t size(graph::TensorId id) const {
    const auto& info = executor_.graph().tensors[id];
    return executor_.layout().rows(info.rows) * info.per_row * info.width;
  }
  cpu::Executor<T> executor_;
};

}  // namespace

std::unique_ptr<Runner> make_cpu_runner(graph::Graph graph, Precision precision, bool retain) {
  if (precision == Precision::f32) return std::make_unique<CpuRunner<float>>(std::move(graph), retain);
  return std::make_unique<CpuRunner<double>>(std::move(graph), retain);
}

}  // namespace bitr
