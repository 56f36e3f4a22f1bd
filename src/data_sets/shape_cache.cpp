#include "data_sets/shape_cache.hpp"

namespace bitr::data {
namespace {

// The sampling tables of a generated shape, about.
constexpr std::size_t generated_bytes = 150'000;

std::size_t bytes_of(const AnyShape& shape) {
  if (const auto* pair = std::get_if<DensePair>(&shape)) return pair->bytes();
  if (const auto* file = std::get_if<FileShape>(&shape)) return file->bytes();
  return generated_bytes;
}

}  // namespace

std::shared_ptr<const AnyShape> ShapeCache::find(std::uint64_t key) const {
  const std::lock_guard lock(mutex_);
  const auto found = shapes_.find(key);
  return found == shapes_.end() ? nullptr : found->second;
}

void ShapeCache::keep(std::uint64_t key, std::shared_ptr<const AnyShape> shape) {
  const std::size_t bytes = bytes_of(*shape);
  const std::lock_guard lock(mutex_);
  // Two threads may have made the same one.
  if (bytes <= capacity_ - used_ && shapes_.emplace(key, std::move(shape)).second) used_ += bytes;
}

}  // namespace bitr::data
