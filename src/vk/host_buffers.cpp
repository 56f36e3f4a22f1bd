#include "vk/host_buffers.hpp"

#include "export_poses.spv.hpp"
#include "import_positions.spv.hpp"

namespace bitr::vk {
namespace {

constexpr std::uint32_t import_lanes = 128;

}  // namespace

void import_positions(const Context& context, Schedule& schedule, const graph::BatchLayout& layout,
                      const HostBuffers& host, const Range& offsets, const Range& positions,
                      const Range& centroids) {
  const auto pipeline =
      context.pipeline(shaders::import_positions, std::array{import_lanes, host.position_stride});
  schedule.dispatch(pipeline, {host.sources, host.references, offsets, positions, centroids},
                    CloudParameters{layout.clouds()}, {layout.clouds(), 1, 1},
                    9.0 * static_cast<double>(layout.rows(graph::Rows::point)));
}

void export_poses(const Context& context, Schedule& schedule, const graph::BatchLayout& layout,
                  const HostBuffers& host, const Range& pose, const Range& centroids) {
  const auto pipeline = context.pipeline(shaders::export_poses, std::array{tile_rows});
  schedule.dispatch(pipeline, {pose, centroids, host.poses}, CloudParameters{layout.clouds()},
                    {(layout.pairs() + tile_rows - 1) / tile_rows, 1, 1}, 40.0 * layout.pairs());
}

}  // namespace bitr::vk
