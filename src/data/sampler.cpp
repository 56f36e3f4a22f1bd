#include <algorithm>
#include <bitr/data.hpp>
#include <condition_variable>
#include <mutex>
#include <system_error>
#include <thread>

#include "api/guarded.hpp"

namespace bitr {

/// A ring of places. Threads take the next place in turn and fill it; next() empties them in the same order.
class Sampler::Queue {
 public:
  Queue(const DataSet& data, const SamplerOptions& options)
      : data_(data), start_(options.start), places_(std::max<std::size_t>(options.ahead, 1)) {
    start_.fingerprint = data.fingerprint();
    const unsigned threads = std::min(options.threads, 256u);
    try {
      for (unsigned i = 0; i < threads; ++i) threads_.emplace_back([this] { work(); });
    } catch (const std::system_error&) {
      // Those that started do the work; without any, next() does.
    }
  }

  ~Queue() {
    {
      const std::lock_guard lock(mutex_);
      stop_ = true;
    }
    room_.notify_all();
    for (std::thread& thread : threads_) thread.join();
  }

  Result<DataSample> next() {
    const std::lock_guard turn(callers_);
    std::unique_lock lock(mutex_);
    if (threads_.empty()) {
      const std::uint64_t number = given_++;
      lock.unlock();
      return draw(number);
    }
    std::optional<Result<DataSample>>& place = places_[given_ % places_.size()];
    filled_.wait(lock, [&] { return place.has_value(); });
    Result<DataSample> sample = std::move(*place);
    place.reset();
    ++given_;
    room_.notify_one();
    return sample;
  }

  DataPosition position() const {
    const std::lock_guard lock(mutex_);
    return place_of(given_);
  }

 private:
  DataPosition place_of(std::uint64_t number) const {
    const std::uint64_t index = start_.index + number;
    return {start_.epoch + index / data_.samples(), index % data_.samples(), start_.fingerprint};
  }

  Result<DataSample> draw(std::uint64_t number) const {
    const DataPosition at = place_of(number);
    return data_.sample(at.epoch, at.index);
  }

  void work() {
    for (;;) {
      std::uint64_t number = 0;
      {
        std::unique_lock lock(mutex_);
        room_.wait(lock, [&] { return stop_ || taken_ < given_ + places_.size(); });
        if (stop_) return;
        number = taken_++;
      }
      Result<DataSample> sample = draw(number);
      {
        const std::lock_guard lock(mutex_);
        places_[number % places_.size()] = std::move(sample);
      }
      filled_.notify_one();
    }
  }

  DataSet data_;
  DataPosition start_;
  std::mutex callers_;  // one next() at a time
  mutable std::mutex mutex_;
  std::condition_variable room_, filled_;
  std::vector<std::optional<Result<DataSample>>> places_;
  std::uint64_t taken_ = 0;  // numbers that threads have taken on
  std::uint64_t given_ = 0;  // samples that next() has given
  bool stop_ = false;
  std::vector<std::thread> threads_;
};

Sampler::Sampler(std::unique_ptr<Queue> queue) : queue_(std::move(queue)) {}
Sampler::Sampler(Sampler&&) noexcept = default;
Sampler& Sampler::operator=(Sampler&&) noexcept = default;
Sampler::~Sampler() = default;

Result<Sampler> Sampler::start(const DataSet& data, const SamplerOptions& options) {
  return guarded([&]() -> Result<Sampler> {
    const auto& [epoch, index, fingerprint] = options.start;
    if (options.ahead < 1) return fail(ErrorCode::invalid_argument, "0 samples ahead; at least 1 is needed");
    if (fingerprint != 0 && fingerprint != data.fingerprint())
      return fail(ErrorCode::invalid_argument,
                  "the position is of another data set: other shapes or other options");
    if (index >= data.samples())
      return fail(ErrorCode::invalid_argument, "the position is sample " + std::to_string(index) +
                                                   " of an epoch of " + std::to_string(data.samples()));
    return Sampler(std::make_unique<Queue>(data, options));
  });
}

Result<DataSample> Sampler::next() { return queue_->next(); }
DataPosition Sampler::position() const { return queue_->position(); }

}  // namespace bitr
