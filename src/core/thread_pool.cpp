#include "core/thread_pool.hpp"

#include <sched.h>

#include <algorithm>
#include <new>
#include <system_error>

namespace bitr {
namespace {

unsigned allowed_cores() {
  cpu_set_t set;
  if (sched_getaffinity(0, sizeof set, &set) == 0) return static_cast<unsigned>(std::max(1, CPU_COUNT(&set)));
  return std::max(1u, std::thread::hardware_concurrency());
}

// Operations follow each other within microseconds: a worker looks this often for the next one before it
// sleeps.
constexpr int spins_before_sleep = 2000;
constexpr unsigned most_threads = 1024;

}  // namespace

ThreadPool::ThreadPool(unsigned threads) {
  const unsigned count = std::min(threads == 0 ? allowed_cores() : threads, most_threads);
  workers_.reserve(count);
  try {
    for (unsigned i = 1; i < count; ++i) workers_.emplace_back([this] { work(); });
  } catch (const std::system_error&) {
    // Those that started do the work.
  } catch (const std::bad_alloc&) {
    // The same.
  }
}

ThreadPool::~ThreadPool() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
    ++generation_;
  }
  wake_.notify_all();
  for (std::thread& worker : workers_) worker.join();
}

void ThreadPool::drain(Job& job) {
  for (;;) {
    const std::size_t begin = job.next.fetch_add(job.grain, std::memory_order_relaxed);
    if (begin >= job.count) return;
    try {
      (*job.body)(begin, std::min(begin + job.grain, job.count));
    } catch (...) {
      if (!job.failed.test_and_set()) job.error = std::current_exception();
      job.next = job.count;
    }
  }
}

void ThreadPool::parallel_for(std::size_t count, std::size_t grain,
                              const std::function<void(std::size_t, std::size_t)>& body) {
  if (count == 0) return;
  if (workers_.empty() || count <= grain) {
    for (std::size_t begin = 0; begin < count; begin += grain) body(begin, std::min(begin + grain, count));
    return;
  }
  const std::lock_guard turn(callers_);
  Job job{.body = &body, .count = count, .grain = grain};
  {
    const std::lock_guard lock(mutex_);
    job_ = &job;
    busy_ = static_cast<unsigned>(workers_.size());
    ++generation_;
  }
  wake_.notify_all();
  drain(job);
  std::unique_lock lock(mutex_);
  done_.wait(lock, [&] { return busy_ == 0; });
  job_ = nullptr;
  if (job.error) std::rethrow_exception(job.error);
}

void ThreadPool::work() {
  unsigned seen = 0;
  for (;;) {
    for (int i = 0; i < spins_before_sleep && generation_.load(std::memory_order_acquire) == seen; ++i)
      std::this_thread::yield();
    Job* job = nullptr;
    {
      std::unique_lock lock(mutex_);
      wake_.wait(lock, [&] { return generation_ != seen; });
      seen = generation_;
      if (stop_) return;
      job = job_;
    }
    drain(*job);
    const std::lock_guard lock(mutex_);
    if (--busy_ == 0) done_.notify_one();
  }
}

}  // namespace bitr
