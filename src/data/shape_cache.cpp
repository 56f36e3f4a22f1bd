#include "data/shape_cache.hpp"

namespace bitr::data {
namespace {

// The sampling tables of a generated shape, about.
constexpr std::size_t generated_bytes = 150'000;

std::size_t bytes_of(const AnyShape& shape) {
  const auto* file = std::get_if<FileShape>(&shape);
  return file ? file->bytes() : generated_bytes;
}

}  // namespace

std::shared_ptr<const AnyShape> ShapeCache::find(std::uint64_t key) {
  const std::lock_guard lock(mutex_);
  const auto found = by_key_.find(key);
  if (found == by_key_.end()) return nullptr;
  entries_.splice(entries_.begin(), entries_, found->second);
  return found->second->shape;
}

void ShapeCache::keep(std::uint64_t key, std::shared_ptr<const AnyShape> shape) {
  const std::size_t bytes = bytes_of(*shape);
  const std::lock_guard lock(mutex_);
  // Two threads may have made the same one; and what cannot fit shall not push everything else out.
  if (bytes > capacity_ || by_key_.contains(key)) return;
  entries_.push_front({key, std::move(shape), bytes});
  by_key_[key] = entries_.begin();
  used_ += bytes;
  while (used_ > capacity_) {
    used_ -= entries_.back().bytes;
    by_key_.erase(entries_.back().key);
    entries_.pop_back();
  }
}

}  // namespace bitr::data
