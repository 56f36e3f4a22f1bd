// Shapes that will be used again, as many as fit in a given amount of memory.
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <unordered_map>
#include <variant>

#include "data_sets/dense_pair.hpp"
#include "data_sets/file_shape.hpp"
#include "generate/shape.hpp"

namespace bitr::data {

using AnyShape = std::variant<std::unique_ptr<generate::Shape>, DensePair, FileShape>;

/// What came first stays: every shape is used as often, in one order after the other, in which the least
/// recently used is likely to be the next. Calls may be made from several threads at once.
class ShapeCache {
 public:
  explicit ShapeCache(std::size_t capacity_bytes) : capacity_(capacity_bytes) {}
  std::shared_ptr<const AnyShape> find(std::uint64_t key) const;
  void keep(std::uint64_t key, std::shared_ptr<const AnyShape> shape);

 private:
  mutable std::mutex mutex_;
  std::size_t capacity_, used_ = 0;
  std::unordered_map<std::uint64_t, std::shared_ptr<const AnyShape>> shapes_;
};

}  // namespace bitr::data
