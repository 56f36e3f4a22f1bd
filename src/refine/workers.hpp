// The threads of a device, or the caller's own where those are busy with other pairs.
#pragma once

#include <cstddef>
#include <functional>

#include "cpu/thread_pool.hpp"

namespace bitr::refine {

struct Workers {
  cpu::ThreadPool* pool = nullptr;  ///< null: the calling thread

  /// body(begin, end) on pieces of [0, count); as ThreadPool::parallel_for.
  void parallel_for(std::size_t count, std::size_t grain,
                    const std::function<void(std::size_t, std::size_t)>& body) const {
    if (pool && count > grain) return pool->parallel_for(count, grain, body);
    if (count > 0) body(0, count);
  }
};

}  // namespace bitr::refine
