#include <bitr/cloud.hpp>
#include <cstring>

namespace bitr {

Vec3d Vec3View::operator[](std::size_t row) const {
  const auto* at = static_cast<const std::byte*>(data) + row * stride;
  if (scalar == Scalar::f64) {
    Vec3d value;
    std::memcpy(value.data(), at, sizeof value);
    return value;
  }
  Vec3f value;
  std::memcpy(value.data(), at, sizeof value);
  return {value[0], value[1], value[2]};
}

}  // namespace bitr
