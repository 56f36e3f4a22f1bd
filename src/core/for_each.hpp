// Work that may be shared out among threads, by whoever has them.
#pragma once

#include <cstddef>
#include <functional>

namespace bitr {

/// Calls work(i) for every i < count, in any order and from any thread.
using ForEach = std::function<void(std::size_t count, const std::function<void(std::size_t)>& work)>;

inline void one_by_one(std::size_t count, const std::function<void(std::size_t)>& work) {
  for (std::size_t i = 0; i < count; ++i) work(i);
}

}  // namespace bitr
