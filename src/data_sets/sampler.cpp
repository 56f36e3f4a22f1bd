#include <algorithm>
#include <bitr/data.hpp>

#include "core/guarded.hpp"
#include "core/read_ahead.hpp"

namespace bitr {

class Sampler::Queue {
 public:
  Queue(const DataSet& data, const SamplerOptions& options)
      : data_(data),
        start_{options.start.epoch, options.start.index, data.fingerprint()},
        samples_(std::min(options.threads, 256u), options.ahead, [this](std::uint64_t number) {
          const DataPosition at = place_of(number);
          return data_.sample(at.epoch, at.index);
        }) {}

  Result<DataSample> next() { return samples_.next(); }
  DataPosition position() const { return place_of(samples_.given()); }

 private:
  DataPosition place_of(std::uint64_t number) const {
    const std::uint64_t index = start_.index + number;
    return {start_.epoch + index / data_.samples(), index % data_.samples(), start_.fingerprint};
  }

  DataSet data_;
  DataPosition start_;
  ReadAhead<Result<DataSample>> samples_;
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

Result<DataSample> Sampler::next() {
  return guarded([&] { return queue_->next(); });
}
DataPosition Sampler::position() const { return queue_->position(); }

}  // namespace bitr
