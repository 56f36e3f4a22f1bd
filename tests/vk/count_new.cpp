#include "vk/count_new.hpp"

#include <cstdlib>
#include <new>

namespace {

[[maybe_unused]] thread_local std::size_t count = 0;

}  // namespace

std::size_t bitr::test::allocations_of_this_thread() { return count; }

// Sanitizers have an operator new of their own, which must meet its delete.
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
void* operator new(std::size_t size) {
  ++count;
  if (void* memory = std::malloc(size)) return memory;
  throw std::bad_alloc();
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
#endif
