#include "vk/cloud_coefficients.hpp"

#include <algorithm>

#include "cloud_coefficients.spv.hpp"
#include "core/failure.hpp"
#include "vk/kernel.hpp"

namespace bitr::vk {
namespace {

using Eigen::MatrixXd;

constexpr std::size_t cloud_coefficients_group = 128;
constexpr std::size_t cloud_coefficients_numbers = 4096;

class CloudCoefficientsKernel : public Kernel {
 public:
  CloudCoefficientsKernel(const KernelContext& site, const ops::CloudCoefficients& op)
      : capabilities_(site.context.capabilities()) {
    const ops::PointAttention& layer = op.layer;
    const int c0 = layer.c0, c1 = layer.c1, heads = layer.heads, extra = op.full.c0 - c0;
    for (const MatrixXd& matrix : cloud_layer_weights(op, site.in[1].width)) add_constants(matrix);
    require(extra, c1, heads * (c0 + 2 * c1 + op.full.c0 + 1) + layer.m0 * (1 + heads), layer);

    pipeline_ = site.context.pipeline(shaders::cloud_coefficients,
                                      std::array{number(cloud_coefficients_group), number(c0), number(c1),
                                                 number(site.in[1].width), number(layer.m0), number(heads)});
  }

  void record(const Arguments& args) const override {
    const std::uint32_t clouds = args.layout.clouds();
    for (std::uint32_t first = 0; first < clouds; first += capabilities_.groups) {
      const std::uint32_t count = std::min(clouds - first, capabilities_.groups);
      args.schedule.dispatch(pipeline_,
                             {args.in[0].range, args.in[1].range, args.constants, args.out[0].range},
                             SegmentParameters{first, clouds}, {count, 1, 1}, cost_ * count);
    }
  }

 private:
  // Iterations of all loops of an invocation.
  static std::size_t iterations(int extra, int c1, int rows, const ops::PointAttention& layer) {
    const auto rounds = [](int count) {
      return (count + cloud_coefficients_group - 1) / cloud_coefficients_group;
    };
    const int from = layer.c0 + 1;
    const std::size_t e = static_cast<std::size_t>(extra), v = static_cast<std::size_t>(c1);
    return rounds(extra + 3 * c1) + rounds(rows) * (1 + e) +
           rounds(layer.heads * layer.n0() * from) * (1 + v) +
           rounds(layer.m0 * layer.heads * layer.n0()) * (1 + v) + rounds(layer.m0 * from) +
           rounds(layer.heads * from * from) * (1 + e) + rounds(layer.m0 * layer.heads * from);
  }

  void require(int extra, int c1, int rows, const ops::PointAttention& layer) {
    const std::size_t loops = iterations(extra, c1, rows, layer);
    cost_ = 2.0 * cloud_coefficients_group * static_cast<double>(loops);
    if (static_cast<std::size_t>(extra + 3 * c1 + rows) > cloud_coefficients_numbers ||
        loops >= capabilities_.loop_limit)
      throw Failure(ErrorCode::unsupported,
                    "the key points' last layer has too many channels for " + capabilities_.name);
  }

  const Capabilities& capabilities_;
  PipelineOf<SegmentParameters> pipeline_;
  double cost_ = 0;
};

}  // namespace

std::vector<MatrixXd> cloud_layer_weights(const ops::CloudCoefficients& op, int globals) {
  const ops::PointAttention &full = op.full, &layer = op.layer;
  const int c0 = layer.c0, c1 = layer.c1, heads = layer.heads, extra = full.c0 - c0;
  const int n = full.n0(), z = full.c0 + 1;
  if (extra != 2 * (globals + c0) || full.c1 != 2 * c1 || full.direction || layer.m0 == 0)
    throw Failure(ErrorCode::internal, "cloud_coefficients: not the features that a cloud is extended by");

  // Paths that are 1 on every edge of positive length are part of the skip connection; edges of length
  // zero carry the difference. All of that is linear, so it is done here.
  MatrixXd keys(heads * (c0 + 2 * c1), z), values(layer.m0, heads * (c0 + 2 * c1));
  MatrixXd zero_keys = full.Mz0, zero_values = full.Oz0, skip = full.S0;
  for (int h = 0; h < heads; ++h) {
    const int at = h * (c0 + 2 * c1);
    keys.middleRows(at, c0) = full.M0.middleRows(h * n, c0);
    keys.middleRows(at + c0, 2 * c1) = full.M0.middleRows(h * n + full.c0, 2 * c1);
    values.middleCols(at, c0) = full.O0.middleCols(h * n, c0);
    values.middleCols(at + c0, 2 * c1) = full.O0.middleCols(h * n + full.c0, 2 * c1);
    zero_keys.middleRows(h * z + c0, extra) -= full.M0.middleRows(h * n + c0, extra);
    zero_values.middleCols(h * z + c0, extra) -= full.O0.middleCols(h * n + c0, extra);
    skip.middleCols(c0, extra) += full.O0.middleCols(h * n + c0, extra);
  }
  return {keys, zero_keys, skip, zero_values, values};
}

template <>
KernelPtr make_kernel(const KernelContext& site, const ops::CloudCoefficients& op) {
  return std::make_unique<CloudCoefficientsKernel>(site, op);
}

}  // namespace bitr::vk
