// What every CPU kernel is: an operation made ready for one arithmetic type, run on slots of memory.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <span>

#include "cpu/thread_pool.hpp"
#include "graph/batch_layout.hpp"
#include "ops/op.hpp"

namespace bitr::cpu {

/// Eight edges, or eight points, at once.
constexpr int lane_count = 8;
template <class T>
using Lanes = Eigen::Array<T, lane_count, 1>;
template <class T>
using RowMatrix = Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// One tensor's memory.
struct Slot {
  void* data = nullptr;
  graph::Rows rows = graph::Rows::point;
  int per_row = 1;
  int width = 1;

  template <class T>
  T* as() const {
    return static_cast<T*>(data);
  }
  std::size_t stride() const { return static_cast<std::size_t>(per_row) * static_cast<std::size_t>(width); }
};

struct Arguments {
  ThreadPool& pool;
  const graph::BatchLayout& layout;
  std::span<const Slot> in;
  std::span<const Slot> out;

  std::size_t rows(const Slot& slot) const { return layout.rows(slot.rows); }
};

template <class T>
class Kernel {
 public:
  virtual ~Kernel() = default;
  virtual void run(const Arguments& args) const = 0;
};

template <class T>
using KernelPtr = std::unique_ptr<Kernel<T>>;

// One maker per operation, each in the file of its stem.
template <class T>
KernelPtr<T> make_kernel(const ops::Knn& op);
template <class T>
KernelPtr<T> make_kernel(const ops::EdgeGeometry& op);
template <class T>
KernelPtr<T> make_kernel(const ops::InputFeatures& op);
template <class T>
KernelPtr<T> make_kernel(const ops::Convolve& op);
template <class T>
KernelPtr<T> make_kernel(const ops::Linear& op);
template <class T>
KernelPtr<T> make_kernel(const ops::Attend& op);
template <class T>
KernelPtr<T> make_kernel(const ops::ProjectedRelu& op);
template <class T>
KernelPtr<T> make_kernel(const ops::CloudSoftmax& op);
template <class T>
KernelPtr<T> make_kernel(const ops::CloudSum& op);
template <class T>
KernelPtr<T> make_kernel(const ops::ExtendFeatures& op);
template <class T>
KernelPtr<T> make_kernel(const ops::MergePairs& op);
template <class T>
KernelPtr<T> make_kernel(const ops::Head& op);
template <class T>
KernelPtr<T> make_kernel(const ops::ProjectPose& op);
template <class T>
KernelPtr<T> make_kernel(const ops::MeanDirection& op);
template <class T>
KernelPtr<T> make_kernel(const ops::PointAttention& op);
template <class T>
KernelPtr<T> make_kernel(const ops::CloudCoefficients& op);
template <class T>
KernelPtr<T> make_kernel(const ops::SoftmaxSum& op);
template <class T>
KernelPtr<T> make_kernel(const ops::PairAttention& op);
template <class T>
KernelPtr<T> make_kernel(const ops::CgProduct& op);
template <class T>
KernelPtr<T> make_kernel(const ops::NeighbourAttention& op);

}  // namespace bitr::cpu
