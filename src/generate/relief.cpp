#include "generate/relief.hpp"

#include <cmath>
#include <numbers>

namespace bitr::generate {

Relief::Relief(double roughness, Random& random) {
  constexpr int octaves = 4, waves_per_octave = 5;
  constexpr double longest_wave = 0.4, two_pi = 2 * std::numbers::pi;
  const double bend = random.uniform(-0.5, 0.5), other_bend = random.uniform(-0.5, 0.5),
               twist = random.uniform(-0.3, 0.3);
  curvature_ << bend, twist, twist, other_bend;

  double variance = 0;
  for (int octave = 0; octave < octaves; ++octave)
    for (int i = 0; i < waves_per_octave; ++i) {
      const double scale = std::exp2(octave + random.uniform(-0.3, 0.3));
      const double direction = random.uniform(0, two_pi);
      waves_.push_back(
          {two_pi * scale / longest_wave * Eigen::Vector2d(std::cos(direction), std::sin(direction)),
           random.uniform(0, two_pi), 1 / scale});
      variance += 1 / (2 * scale * scale);
    }
  for (Wave& wave : waves_) wave.amplitude *= roughness / std::sqrt(variance);
}

double Relief::height(const Eigen::Vector2d& at) const {
  double height = at.dot(curvature_ * at);
  for (const Wave& wave : waves_) height += wave.amplitude * std::cos(wave.frequency.dot(at) + wave.phase);
  return height;
}

double Relief::steepest(double radius) const {
  double slope = 2 * radius * curvature_.norm();
  for (const Wave& wave : waves_) slope += wave.amplitude * wave.frequency.norm();
  return slope;
}

}  // namespace bitr::generate
