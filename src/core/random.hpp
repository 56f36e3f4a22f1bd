// Random numbers that are the same on every platform: the generator is fixed by the standard, and the
// distributions (which are not) are written here.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <random>

namespace bitr {

class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed ^ 0x9e3779b97f4a7c15ULL) {}

  std::uint64_t bits() { return engine_(); }
  /// Uniform in [0, 1), 53 bits.
  double uniform() { return static_cast<double>(engine_() >> 11) * 0x1p-53; }
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  /// Uniform in 0 … bound − 1, without modulo bias. bound > 0.
  std::uint64_t below(std::uint64_t bound) {
    const std::uint64_t reject = (0 - bound) % bound;
    std::uint64_t draw = engine_();
    while (draw < reject) draw = engine_();
    return draw % bound;
  }
  /// Standard normal (Box–Muller).
  double normal() {
    const double radius = std::sqrt(-2 * std::log(1 - uniform()));
    return radius * std::cos(2 * std::numbers::pi * uniform());
  }
  /// Uniform on SO(3), row-major: a random unit quaternion.
  std::array<double, 9> rotation() {
    double q[4], norm = 0;
    for (double& c : q) {
      c = normal();
      norm += c * c;
    }
    for (double& c : q) c /= std::sqrt(norm);
    const double w = q[0], x = q[1], y = q[2], z = q[3];
    return {1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
            2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
            2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
  }

 private:
  std::mt19937_64 engine_;
};

}  // namespace bitr
