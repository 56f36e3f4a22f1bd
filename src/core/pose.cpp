#include <bitr/pose.hpp>
#include <cmath>
#include <numbers>

namespace bitr {

Vec3d Pose::rotate(const Vec3d& v) const {
  const auto& r = rotation;
  return {r[0] * v[0] + r[1] * v[1] + r[2] * v[2], r[3] * v[0] + r[4] * v[1] + r[5] * v[2],
          r[6] * v[0] + r[7] * v[1] + r[8] * v[2]};
}

Vec3d Pose::apply(const Vec3d& point) const {
  const Vec3d v = rotate(point);
  return {v[0] + translation[0], v[1] + translation[1], v[2] + translation[2]};
}

Pose Pose::inverse() const {
  Pose inv;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) inv.rotation[3 * i + j] = rotation[3 * j + i];
  const Vec3d t = inv.rotate(translation);
  inv.translation = {-t[0], -t[1], -t[2]};
  return inv;
}

std::array<double, 16> Pose::matrix() const {
  const auto& r = rotation;
  const auto& t = translation;
  return {r[0], r[1], r[2], t[0], r[3], r[4], r[5], t[1], r[6], r[7], r[8], t[2], 0, 0, 0, 1};
}

Pose operator*(const Pose& a, const Pose& b) {
  Pose ab;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      double sum = 0;
      for (int k = 0; k < 3; ++k) sum += a.rotation[3 * i + k] * b.rotation[3 * k + j];
      ab.rotation[3 * i + j] = sum;
    }
  ab.translation = a.apply(b.translation);
  return ab;
}

double rotation_error_degrees(const Pose& a, const Pose& b) {
  // The sine comes from the antisymmetric part, which is small and exact at both 0° and 180°.
  const auto r = (a.inverse() * b).rotation;
  const double sine = std::hypot(r[7] - r[5], r[2] - r[6], r[3] - r[1]) / 2;
  const double cosine = (r[0] + r[4] + r[8] - 1) / 2;
  return std::atan2(sine, cosine) * 180 / std::numbers::pi;
}

double translation_error(const Pose& a, const Pose& b) {
  return std::hypot(a.translation[0] - b.translation[0], a.translation[1] - b.translation[1],
                    a.translation[2] - b.translation[2]);
}

}  // namespace bitr
