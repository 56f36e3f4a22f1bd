// What the calling thread has allocated with operator new.
#pragma once

#include <cstddef>

namespace bitr::test {

std::size_t allocations_of_this_thread();

}  // namespace bitr::test
