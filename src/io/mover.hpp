// Copies a file while a parser reads it, its points and normals moved and every other byte as it is.
#pragma once

#include <array>
#include <bitr/pose.hpp>
#include <vector>

#include "io/complaint.hpp"
#include "io/scalar.hpp"

namespace bitr::io {

/// The parser says where the values of a point (or of a normal alone) stand, in any order, then that these
/// were all. Roles as of cloud_builder.hpp; those of colours and of other columns are passed over.
class Mover {
 public:
  Mover(std::span<const std::byte> bytes, const Pose& pose);

  /// A number in digits. `type`: what the file says it is; f64 where it says nothing.
  void word(int role, std::string_view word, double value, ScalarType type = ScalarType::f64);
  /// A number in bytes.
  void number(int role, ScalarType type, const std::byte* at, std::endian order = std::endian::little);
  /// Writes what was said of the point. `unsupported` for integers, `invalid_argument` when a moved value is
  /// beyond its type.
  Result<void> end_row(const File& file, Place place);

  /// Leaves what was said of the point as it is.
  void leave_row() { slots_ = {}; }

  /// From now on numbers stand in this memory, and are changed there.
  void work_in(std::span<std::byte> memory) { memory_ = memory; }
  /// Everything so far, then these bytes instead of those of the file up to `end`.
  void replace(std::size_t begin, std::size_t end, std::span<const std::byte> with);

  /// The whole file.
  std::vector<std::byte> finish();

 private:
  struct Slot {
    const std::byte* at = nullptr;
    std::size_t size = 0;
    double value = 0;
    ScalarType type = ScalarType::f64;
    std::endian order = std::endian::little;
    bool digits = false;
  };
  void add(int role, Slot slot);
  bool has(int first) const { return slots_[first].at && slots_[first + 1].at && slots_[first + 2].at; }
  Result<void> write(const Slot& slot, const File& file, Place place);
  void copy_until(std::size_t end);

  std::span<const std::byte> bytes_;
  std::span<std::byte> memory_;
  const Pose& pose_;
  std::vector<std::byte> out_;
  std::size_t copied_ = 0;  ///< how far out_ is with the file
  std::array<Slot, 6> slots_;
};

}  // namespace bitr::io
