// The parts of run_doctor().
#pragma once

#include <bitr/assemble.hpp>
#include <bitr/doctor.hpp>
#include <span>

namespace bitr {

/// A pair of random clouds.
struct RandomPair {
  std::vector<Vec3d> source, reference;
  CloudPair view() const { return {CloudView(Vec3View(source)), CloudView(Vec3View(reference))}; }
};

/// Very different sizes, from the smallest a model takes; each pair's rotation is well determined, so that
/// rounding moves it by little.
std::vector<RandomPair> doctor_pairs(const Model& model);

/// Batches of larger clouds, one that is searched by brute force and one by the tree.
std::vector<std::vector<RandomPair>> large_batches();

/// One way to run the network.
struct OperationsRun {
  const Model& model;
  Mode mode;
  const std::vector<RandomPair>& pairs;
};

/// Adds a check for each operation's name: the worst over all runs. Like the others throws Failure
/// (`device_lost`).
void check_operations(const Device& device, std::span<const OperationsRun> runs, std::vector<Check>& checks);
void check_passes(const Device& device, const Model& model, const std::vector<RandomPair>& pairs,
                  std::vector<Check>& checks);
/// On a Vulkan device against the CPU.
void check_refinement(const Device& device, std::vector<Check>& checks);

}  // namespace bitr
