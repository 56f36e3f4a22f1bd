// Shapes that may be used again, as many as fit in a given amount of memory.
#pragma once

#include <cstdint>
#include <list>
#include <memory>
#include <mutex>
#include <unordered_map>
#include <variant>

#include "data/file_shape.hpp"
#include "generate/shape.hpp"

namespace bitr::data {

using AnyShape = std::variant<std::unique_ptr<generate::Shape>, FileShape>;

/// The least recently used go first. Calls may be made from several threads at once.
class ShapeCache {
 public:
  explicit ShapeCache(std::size_t capacity_bytes) : capacity_(capacity_bytes) {}
  std::shared_ptr<const AnyShape> find(std::uint64_t key);
  void keep(std::uint64_t key, std::shared_ptr<const AnyShape> shape);

 private:
  struct Entry {
    std::uint64_t key;
    std::shared_ptr<const AnyShape> shape;
    std::size_t bytes;
  };
  std::mutex mutex_;
  std::size_t capacity_, used_ = 0;
  std::list<Entry> entries_;  ///< the last used first
  std::unordered_map<std::uint64_t, std::list<Entry>::iterator> by_key_;
};

}  // namespace bitr::data
