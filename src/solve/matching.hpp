// Points of two clouds that look like each other more than like any other.
#pragma once

#include <cstdint>
#include <vector>

#include "core/thread_pool.hpp"
#include "solve/descriptors.hpp"

namespace bitr::solving {

struct Pairing {
  std::uint32_t source, reference;
  float distance;  ///< of the descriptors, squared
};

/// Those that are each other's nearest in the space of descriptors, in the order of the source's points.
std::vector<Pairing> mutual_nearest(const Descriptors& source, const Descriptors& reference,
                                    ThreadPool& pool);

}  // namespace bitr::solving
