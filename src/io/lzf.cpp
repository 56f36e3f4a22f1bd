#include "io/lzf.hpp"

#include <algorithm>
#include <vector>

namespace bitr::io {
namespace {

constexpr std::size_t furthest = 8192;               // that a repetition reaches back
constexpr std::size_t longest = 264;                 // that one step unpacks
constexpr std::size_t piece = std::size_t{1} << 20;  // that is given away at once
constexpr unsigned first_repetition = 32,
                   long_run = 7;  // in a step's first byte, and in its upper three bits

class Unpacker {
 public:
  Unpacker(std::span<const std::byte> packed, std::uint64_t size,
           const std::function<void(std::uint64_t, std::span<const std::byte>)>& take)
      : packed_(packed), size_(size), take_(take), buffer_(furthest + piece + longest) {}

  LzfUnpacked run() {
    while (at_ < packed_.size() && step())
      if (end_ >= furthest + piece) give();
    give();
    return {given_, at_ == packed_.size() && !damaged_ && given_ == size_};
  }

 private:
  unsigned byte() { return std::to_integer<unsigned>(packed_[at_++]); }

  bool damaged() {
    damaged_ = true;
    return false;
  }

  bool step() {
    const unsigned first = byte();
    return first < first_repetition ? copy(first + 1) : repeat(first);
  }

  bool fits(std::size_t length) const { return length <= size_ - given_ - (end_ - begin_); }

  bool copy(std::size_t length) {
    if (length > packed_.size() - at_ || !fits(length)) return damaged();
    std::copy_n(packed_.begin() + static_cast<std::ptrdiff_t>(at_), length, at_end());
    at_ += length;
    end_ += length;
    return true;
  }

  bool repeat(unsigned first) {
    std::size_t length = first >> 5;
    if (packed_.size() - at_ < (length == long_run ? 2 : 1)) return damaged();
    if (length == long_run) length += byte();
    length += 2;
    const std::size_t distance = ((first & 31) << 8 | byte()) + 1;
    if (distance > end_ || !fits(length)) return damaged();
    // It may reach into what it makes: that is how a run is packed.
    auto from = at_end() - static_cast<std::ptrdiff_t>(distance);
    for (auto to = at_end(); length > 0; --length, ++end_) *to++ = *from++;
    return true;
  }

  std::vector<std::byte>::iterator at_end() { return buffer_.begin() + static_cast<std::ptrdiff_t>(end_); }

  /// Keeps what a repetition may still reach.
  void give() {
    take_(given_, std::span(buffer_).subspan(begin_, end_ - begin_));
    given_ += end_ - begin_;
    const std::size_t kept = std::min(end_, furthest);
    std::copy(at_end() - static_cast<std::ptrdiff_t>(kept), at_end(), buffer_.begin());
    begin_ = end_ = kept;
  }

  std::span<const std::byte> packed_;
  std::uint64_t size_, given_ = 0;
  const std::function<void(std::uint64_t, std::span<const std::byte>)>& take_;
  std::vector<std::byte> buffer_;
  std::size_t at_ = 0, begin_ = 0, end_ = 0;  // in packed_; of what is not given away yet, in buffer_
  bool damaged_ = false;
};

}  // namespace

LzfUnpacked unpack_lzf(
    std::span<const std::byte> packed, std::uint64_t size,
    const std::function<void(std::uint64_t offset, std::span<const std::byte> piece)>& take) {
  return Unpacker(packed, size, take).run();
}

}  // namespace bitr::io
