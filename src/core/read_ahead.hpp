// Values made before they are asked for.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <exception>
#include <functional>
#include <mutex>
#include <new>
#include <optional>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

namespace bitr {

/// make(0), make(1), … one after the other, made ahead by threads of its own into a ring of places: which
/// values come does not depend on how many threads there are. What make() throws is thrown by the next() that
/// asks for that value. With more than one thread make() may run for several numbers at once.
template <class Value>
class ReadAhead {
 public:
  using Make = std::function<Value(std::uint64_t)>;

  /// `ahead`: values made ahead at most. Without `threads`, or where the system grants none, a value is made
  /// when it is asked for.
  ReadAhead(unsigned threads, std::size_t ahead, Make make)
      : make_(std::move(make)), places_(ahead > 0 ? ahead : 1) {
    try {
      for (unsigned i = 0; i < threads; ++i) threads_.emplace_back([this] { work(); });
    } catch (const std::system_error&) {
      // Those that started do the work; without any, next() does.
    } catch (const std::bad_alloc&) {
      // The same.
    }
  }
  ReadAhead(const ReadAhead&) = delete;
  ReadAhead& operator=(const ReadAhead&) = delete;
  ~ReadAhead() {
    {
      const std::lock_guard lock(mutex_);
      stop_ = true;
    }
    room_.notify_all();
    for (std::thread& thread : threads_) thread.join();
  }

  Value next() {
    const std::lock_guard turn(callers_);
    std::unique_lock lock(mutex_);
    if (threads_.empty()) {
      const std::uint64_t number = given_++;
      lock.unlock();
      return make_(number);
    }
    Place& place = places_[given_ % places_.size()];
    filled_.wait(lock, [&] { return place.value || place.thrown; });
    Place made = std::exchange(place, {});
    ++given_;
    room_.notify_one();
    if (made.thrown) std::rethrow_exception(made.thrown);
    return std::move(*made.value);
  }

  /// Values that next() has given.
  std::uint64_t given() const {
    const std::lock_guard lock(mutex_);
    return given_;
  }

 private:
  /// A number's value, or what was thrown in its place.
  struct Place {
    std::optional<Value> value;
    std::exception_ptr thrown;
  };

  void work() {
    for (;;) {
      std::uint64_t number = 0;
      {
        std::unique_lock lock(mutex_);
        room_.wait(lock, [&] { return stop_ || taken_ < given_ + places_.size(); });
        if (stop_) return;
        number = taken_++;
      }
      Place made = make(number);
      {
        const std::lock_guard lock(mutex_);
        places_[number % places_.size()] = std::move(made);
      }
      filled_.notify_one();
    }
  }

  Place make(std::uint64_t number) noexcept {
    Place made;
    try {
      made.value.emplace(make_(number));
    } catch (...) {
      made.thrown = std::current_exception();
    }
    return made;
  }

  const Make make_;
  std::mutex callers_;  // one next() at a time
  mutable std::mutex mutex_;
  std::condition_variable room_, filled_;
  std::vector<Place> places_;
  std::uint64_t taken_ = 0;  // numbers that threads have taken on
  std::uint64_t given_ = 0;
  bool stop_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace bitr
