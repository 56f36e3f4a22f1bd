// The threads of a device, or the caller's own where those are busy with other pairs.
#pragma once

#include <bitr/device.hpp>
#include <cstddef>
#include <functional>

#include "api/internal.hpp"
#include "core/thread_pool.hpp"

namespace bitr::refine {

struct Workers {
  ThreadPool* pool = nullptr;  ///< null: the calling thread

  /// body(begin, end) on pieces of [0, count); as ThreadPool::parallel_for.
  void parallel_for(std::size_t count, std::size_t grain,
                    const std::function<void(std::size_t, std::size_t)>& body) const {
    if (pool && count > grain) return pool->parallel_for(count, grain, body);
    if (count > 0) body(0, count);
  }
};

/// body(pair, its workers) for every pair: one on all threads of the device, or every thread with pairs of
/// its own.
template <class Body>
void for_each_pair(const Device& device, std::size_t pairs, const Body& body) {
  const bool alone = pairs < device.threads();
  const Workers workers{alone ? &Internal::pool(device) : nullptr};
  const auto run = [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) body(i, workers);
  };
  if (alone)
    run(0, pairs);
  else
    Internal::pool(device).parallel_for(pairs, 1, run);
}

}  // namespace bitr::refine
