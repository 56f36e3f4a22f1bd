// The surface along which something breaks.
#pragma once

#include <Eigen/Core>
#include <array>

#include "core/random.hpp"

namespace bitr::generate {

/// A height over a plane: a shallow curved base with several octaves of waves on it, each octave with half
/// the wavelength and half the height of the one before.
class Relief {
 public:
  /// `roughness`: standard deviation of the waves, in model units.
  Relief(double roughness, Random& random);

  double height(const Eigen::Vector2d& at) const;
  /// The height's gradient.
  Eigen::Vector2d slope(const Eigen::Vector2d& at) const;
  /// Less than one place in 200 within `radius` of the origin is steeper.
  double steep(double radius) const;

 private:
  static constexpr int octaves = 4, waves_per_octave = 5, waves = octaves * waves_per_octave;
  using PerWave = std::array<double, waves>;
  /// cos(2π(frequency · at + phase + quarter)) of every wave.
  PerWave cosines(const Eigen::Vector2d& at, double quarter) const;

  Eigen::Matrix2d curvature_;
  PerWave frequency_x_, frequency_y_, phase_;  ///< in turns per unit length, and turns
  PerWave amplitude_;
};

}  // namespace bitr::generate
