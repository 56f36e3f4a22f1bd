// Where a plan runs.
#pragma once

#include <bitr/result.hpp>
#include <memory>
#include <string>

namespace bitr {

namespace cpu {
class ThreadPool;
}

/// A handle to a backend and its threads; cheap to copy. Plans on one device may be used from different
/// threads, one thread at a time per plan.
class Device {
 public:
  const std::string& name() const;  ///< the processor's model name, as the system gives it
  unsigned threads() const;

  explicit Device(std::shared_ptr<cpu::ThreadPool> pool) : pool_(std::move(pool)) {}
  cpu::ThreadPool& pool() const { return *pool_; }

 private:
  std::shared_ptr<cpu::ThreadPool> pool_;
};

/// The CPU backend. `threads` = 0 takes every core the process may run on; never more than 1024, or than the
/// system grants (see Device::threads). Results do not depend on the number.
Device cpu_device(unsigned threads = 0);

}  // namespace bitr
