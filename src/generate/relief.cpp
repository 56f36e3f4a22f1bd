#include "generate/relief.hpp"

#include <cmath>
#include <numbers>

namespace bitr::generate {
namespace {

constexpr double two_pi = 2 * std::numbers::pi;

// cos(2π t) to 1e-11, from arithmetic alone, so that loops over it become vector code and every machine gets
// the same: the sine's series within a quarter of a turn.
inline double cosine_of_turns(double t) {
  const double off = std::abs(t - std::floor(t + 0.5));  // from the nearest whole turn, 0 … 1/2
  const double x = two_pi * (0.25 - off), square = x * x;
  double sum = -1.0 / 1307674368000;
  for (const double coefficient :
       {1.0 / 6227020800, -1.0 / 39916800, 1.0 / 362880, -1.0 / 5040, 1.0 / 120, -1.0 / 6, 1.0})
    sum = sum * square + coefficient;
  return x * sum;
}

}  // namespace

Relief::Relief(double roughness, Random& random) {
  constexpr double longest_wave = 0.4;
  const double bend = random.uniform(-0.5, 0.5), other_bend = random.uniform(-0.5, 0.5),
               twist = random.uniform(-0.3, 0.3);
  curvature_ << bend, twist, twist, other_bend;

  double variance = 0;
  for (int i = 0; i < waves; ++i) {
    const int octave = i / waves_per_octave;
    const double scale = std::exp2(octave + random.uniform(-0.3, 0.3));
    const double direction = random.uniform(0, two_pi);
    frequency_x_[i] = scale / longest_wave * std::cos(direction);
    frequency_y_[i] = scale / longest_wave * std::sin(direction);
    phase_[i] = random.uniform();
    amplitude_[i] = 1 / scale;
    variance += 1 / (2 * scale * scale);
  }
  for (double& amplitude : amplitude_) amplitude *= roughness / std::sqrt(variance);
}

Relief::PerWave Relief::cosines(const Eigen::Vector2d& at, double quarter) const {
  const double x = at.x(), y = at.y();
  PerWave cosines;
  for (int i = 0; i < waves; ++i)
    cosines[i] = cosine_of_turns(frequency_x_[i] * x + frequency_y_[i] * y + phase_[i] + quarter);
  return cosines;
}

double Relief::height(const Eigen::Vector2d& at) const {
  const PerWave cosine = cosines(at, 0);
  double height = at.dot(curvature_ * at);
  for (int i = 0; i < waves; ++i) height += amplitude_[i] * cosine[i];
  return height;
}

Eigen::Vector2d Relief::slope(const Eigen::Vector2d& at) const {
  const PerWave minus_sine = cosines(at, 0.25);
  Eigen::Vector2d slope = 2 * curvature_ * at;
  for (int i = 0; i < waves; ++i)
    slope += two_pi * amplitude_[i] * minus_sine[i] * Eigen::Vector2d(frequency_x_[i], frequency_y_[i]);
  return slope;
}

double Relief::steep(double radius) const {
  double square = 0;
  for (int i = 0; i < waves; ++i) {
    const double most = two_pi * amplitude_[i] * std::hypot(frequency_x_[i], frequency_y_[i]);
    square += most * most / 2;
  }
  return 2 * radius * curvature_.norm() + 2.5 * std::sqrt(square);
}

}  // namespace bitr::generate
