// A device's self-check: whether its driver computes what the network is made of, and whether whole passes
// keep the network's promises.
#pragma once

#include <bitr/device.hpp>
#include <bitr/result.hpp>
#include <string>
#include <vector>

namespace bitr {

struct Check {
  std::string name;     ///< what was measured, in which unit
  double measured = 0;  ///< the largest over everything the check looked at
  double allowed = 0;
  std::string problem;  ///< why it could not be measured; empty when it was

  bool passed() const { return problem.empty() && measured <= allowed; }
};

/// Runs the default network, and one as large as those that ship, with untrained weights on random clouds of
/// very different sizes, of up to 5,000 points:
///   - every operation of the folded network on its own, in both modes, against the CPU in double precision:
///     the largest difference over the largest entry; neighbours one by one against the CPU's, of which only
///     exact ties may differ; on a GPU also the memory around every tensor, which must stay untouched;
///   - whole passes against the CPU in double precision, and moved, exchanged, scaled and reordered clouds
///     against what the pose must then be: degrees, and translations over the clouds' size;
///   - the bits of a pair alone, in a batch, and again;
///   - on a GPU refinement, by either method, against the CPU's.
/// All in the device's tier; what training adds to that is not looked at.
/// Seconds on a GPU. An operation that cannot be run is a check that failed; `device_lost` ends it all.
Result<std::vector<Check>> run_doctor(const Device& device);

}  // namespace bitr
