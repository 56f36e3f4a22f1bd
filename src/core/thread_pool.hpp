// Worker threads that share out ranges of rows. What a chunk computes never depends on who runs it, so
// results are the same for any number of threads.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace bitr {

class ThreadPool {
 public:
  /// 0: every core the process may run on. Fewer than asked for when the system refuses more (see threads()).
  explicit ThreadPool(unsigned threads = 0);
  ~ThreadPool();
  ThreadPool(const ThreadPool&) = delete;
  ThreadPool& operator=(const ThreadPool&) = delete;

  unsigned threads() const { return static_cast<unsigned>(workers_.size()) + 1; }

  /// Calls body(begin, end) on pieces of [0, count) of at most `grain` items, on all threads; returns when
  /// all are done. Calls from different threads take turns. What `body` throws is thrown here, once the other
  /// threads have finished. `body` must not call parallel_for.
  void parallel_for(std::size_t count, std::size_t grain,
                    const std::function<void(std::size_t, std::size_t)>& body);

 private:
  struct Job {
    const std::function<void(std::size_t, std::size_t)>* body;
    std::size_t count, grain;
    std::atomic<std::size_t> next{0};
    std::exception_ptr error = nullptr;  // the first one; guarded by `failed`
    std::atomic_flag failed = ATOMIC_FLAG_INIT;
  };
  void work();
  static void drain(Job& job);

  std::vector<std::thread> workers_;
  std::mutex callers_;  // one parallel_for at a time
  std::mutex mutex_;
  std::condition_variable wake_, done_;
  Job* job_ = nullptr;
  std::atomic<unsigned> generation_{0};
  unsigned busy_ = 0;
  bool stop_ = false;
};

}  // namespace bitr
