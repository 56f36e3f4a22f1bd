#include "io/mover.hpp"

#include <algorithm>
#include <cmath>

#include "io/cloud_builder.hpp"

namespace bitr::io {

Mover::Mover(std::span<const std::byte> bytes, const Pose& pose) : bytes_(bytes), pose_(pose) {
  out_.reserve(bytes.size() + bytes.size() / 4);
}

void Mover::add(int role, Slot slot) {
  if (role >= 0 && role < role_red) slots_[role] = slot;
}

void Mover::word(int role, std::string_view word, double value, ScalarType type) {
  add(role,
      {reinterpret_cast<const std::byte*>(word.data()), word.size(), value, type, std::endian::little, true});
}

void Mover::number(int role, ScalarType type, const std::byte* at, std::endian order) {
  add(role, {at, size_of(type), load_as<double>(type, at, order), type, order, false});
}

Result<void> Mover::end_row(const File& file, Place place) {
  for (const int first : {int{role_x}, int{role_nx}}) {
    if (!has(first)) continue;
    Slot* slots = &slots_[first];
    const Vec3d old = {slots[0].value, slots[1].value, slots[2].value};
    const Vec3d moved = first == role_x ? pose_.apply(old) : pose_.rotate(old);
    for (int i = 0; i < 3; ++i) slots[i].value = moved[i];
    // No direction, or none that is a number, stays as it is written.
    const bool none =
        old == Vec3d{0, 0, 0} || !(std::isfinite(old[0]) && std::isfinite(old[1]) && std::isfinite(old[2]));
    if (first == role_nx && none)
      for (int i = 0; i < 3; ++i) slots[i].at = nullptr;
  }
  if (!has(role_x))
    for (int i = 0; i < 3; ++i) slots_[i].at = nullptr;
  std::array<Slot, 6> row = std::exchange(slots_, {});
  std::sort(row.begin(), row.end(), [](const Slot& a, const Slot& b) { return a.at < b.at; });
  for (const Slot& slot : row)
    if (slot.at)
      if (auto written = write(slot, file, place); !written) return written;
  return {};
}

Result<void> Mover::write(const Slot& slot, const File& file, Place place) {
  if (!is_float(slot.type))
    return refuse(ErrorCode::unsupported, file,
                  "coordinates and normals of an integer type cannot be moved; only float and double can");
  const auto single = static_cast<float>(slot.value);
  if (!std::isfinite(slot.value) || (slot.type == ScalarType::f32 && !std::isfinite(single))) {
    const std::string_view unit = place.unit == Place::Unit::byte ? "byte " : "line ";
    return refuse(ErrorCode::invalid_argument, file, unit, place.at, ": moved to ", slot.value,
                  ", which is beyond its type");
  }
  std::array<char, 32> text;
  std::span<const std::byte> with;
  if (slot.digits) {
    char* end = text.data() + text.size();
    end = slot.type == ScalarType::f32 ? std::to_chars(text.data(), end, single).ptr
                                       : std::to_chars(text.data(), end, slot.value).ptr;
    with = std::as_bytes(std::span(text.data(), end));
  } else {
    if (slot.type == ScalarType::f32)
      std::memcpy(text.data(), &single, sizeof single);
    else
      std::memcpy(text.data(), &slot.value, sizeof slot.value);
    if (slot.order != std::endian::native) std::reverse(text.data(), text.data() + slot.size);
    with = std::as_bytes(std::span(text.data(), slot.size));
  }
  if (!memory_.empty()) {
    std::copy(with.begin(), with.end(), memory_.begin() + (slot.at - memory_.data()));
    return {};
  }
  const auto begin = static_cast<std::size_t>(slot.at - bytes_.data());
  replace(begin, begin + slot.size, with);
  return {};
}

void Mover::copy_until(std::size_t end) {
  const auto part = bytes_.subspan(copied_, end - copied_);
  out_.insert(out_.end(), part.begin(), part.end());
  copied_ = end;
}

void Mover::replace(std::size_t begin, std::size_t end, std::span<const std::byte> with) {
  copy_until(begin);
  out_.insert(out_.end(), with.begin(), with.end());
  copied_ = end;
}

std::vector<std::byte> Mover::finish() {
  copy_until(bytes_.size());
  return std::move(out_);
}

}  // namespace bitr::io
