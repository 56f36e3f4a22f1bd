// A host's buffers in place of staging memory: clouds come from where the host made them, poses go where it
// wants them.
#pragma once

#include "vk/kernel.hpp"

namespace bitr::vk {

struct HostBuffers {
  Range sources, references;          ///< f32[points, stride], clouds one after the other
  std::uint32_t position_stride = 3;  ///< numbers from one point to the next
  Range poses;                        ///< f32[pairs, 16]
};

/// Adds the work that reads the host's clouds into `positions` and their `centroids` (f32[clouds, 4]).
void import_positions(const Context& context, Schedule& schedule, const graph::BatchLayout& layout,
                      const HostBuffers& host, const Range& offsets, const Range& positions,
                      const Range& centroids);

/// Adds the work that writes the host's matrices.
void export_poses(const Context& context, Schedule& schedule, const graph::BatchLayout& layout,
                  const HostBuffers& host, const Range& pose, const Range& centroids);

}  // namespace bitr::vk
