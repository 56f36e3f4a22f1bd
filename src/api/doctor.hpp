// The two halves of run_doctor().
#pragma once

#include <bitr/assemble.hpp>
#include <bitr/doctor.hpp>

namespace bitr {

/// A pair of random clouds.
struct RandomPair {
  std::vector<Vec3d> source, reference;
  CloudPair view() const { return {CloudView(Vec3View(source)), CloudView(Vec3View(reference))}; }
};

/// Very different sizes, from the smallest a model takes; each pair's rotation is well determined, so that
/// rounding moves it by little.
std::vector<RandomPair> doctor_pairs(const Model& model);

/// Both throw Failure (`device_lost`).
void check_operations(const Device& device, const Model& model, const std::vector<RandomPair>& pairs,
                      std::vector<Check>& checks);
void check_passes(const Device& device, const Model& model, const std::vector<RandomPair>& pairs,
                  std::vector<Check>& checks);

}  // namespace bitr
