// The surface along which something breaks.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/random.hpp"

namespace bitr::generate {

/// A height over a plane: a shallow curved base with several octaves of waves on it, each octave with half
/// the wavelength and half the height of the one before.
class Relief {
 public:
  /// `roughness`: standard deviation of the waves, in model units.
  Relief(double roughness, Random& random);

  double height(const Eigen::Vector2d& at) const;
  /// No slope within `radius` of the origin is steeper.
  double steepest(double radius) const;

 private:
  struct Wave {
    Eigen::Vector2d frequency;  ///< radians per unit length
    double phase, amplitude;
  };
  Eigen::Matrix2d curvature_;
  std::vector<Wave> waves_;
};

}  // namespace bitr::generate
