#include "vk/host_buffers.hpp"

#include "export_poses.spv.hpp"
#include "import_positions.spv.hpp"

namespace bitr::vk {
namespace {

constexpr std::uint32_t import_lanes = 128;

constexpr Access import_bindings[] = {Access::read, Access::read, Access::read, Access::write, Access::write};
constexpr Shader import_shader{"import_positions", spirv::import_positions, import_bindings,
                               sizeof(CloudParameters), 2};
constexpr Access export_bindings[] = {Access::read, Access::read, Access::write};
constexpr Shader export_shader{"export_poses", spirv::export_poses, export_bindings, sizeof(CloudParameters),
                               1};

}  // namespace

void import_positions(const Context& context, Schedule& schedule, const graph::BatchLayout& layout,
                      const HostBuffers& host, const Range& offsets, const Range& positions,
                      const Range& centroids) {
  const Pipeline& pipeline = context.pipeline(import_shader, std::array{import_lanes, host.position_stride});
  schedule.dispatch(pipeline, {host.sources, host.references, offsets, positions, centroids},
                    CloudParameters{layout.clouds()}, {layout.clouds(), 1, 1},
                    9.0 * static_cast<double>(layout.rows(graph::Rows::point)));
}

void export_poses(const Context& context, Schedule& schedule, const graph::BatchLayout& layout,
                  const HostBuffers& host, const Range& pose, const Range& centroids) {
  const Pipeline& pipeline = context.pipeline(export_shader, std::array{tile_rows});
  schedule.dispatch(pipeline, {pose, centroids, host.poses}, CloudParameters{layout.clouds()},
                    {(layout.pairs() + tile_rows - 1) / tile_rows, 1, 1}, 40.0 * layout.pairs());
}

}  // namespace bitr::vk
