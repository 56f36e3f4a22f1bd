#include "cloud_coefficients_gradient.spv.hpp"

#include <algorithm>

#include "cloud_coefficients_constants.spv.hpp"
#include "cloud_coefficients_inputs.spv.hpp"
#include "core/failure.hpp"
#include "ops/constants.hpp"
#include "vk/cloud_coefficients.hpp"
#include "vk/kernel.hpp"
#include "vk/memory.hpp"

namespace bitr::vk {
namespace {

constexpr std::uint32_t coefficients_gradient_group = 128;
constexpr std::size_t coefficients_gradient_numbers = 4096;
constexpr std::uint32_t most_clouds = 16383;

// Kinds of constants, of cloud_coefficients_constants.comp.
enum Kind : std::uint32_t { none, row, negative_row, value, appended_value };

enum : int { means_input, globals_input };

class CloudCoefficientsGradient : public Kernel {
 public:
  CloudCoefficientsGradient(const KernelContext& site, const ops::Gradient<ops::CloudCoefficients>& op)
      : op_(op),
        capabilities_(site.context.capabilities()),
        c0_(op.op.layer.c0),
        c1_(op.op.layer.c1),
        extra_(op.op.full.c0 - c0_),
        paths_(c0_ + 2 * c1_) {
    if (op.grad_output_at(0) < 0 || !op.constants)
      throw Failure(ErrorCode::internal, "cloud coefficients' gradient that nothing needs");
    for (const Eigen::MatrixXd& matrix : cloud_layer_weights(op.op, site.in[globals_input].width))
      add_constants(matrix);
    require();
    weights_bytes_ = sizeof(std::uint32_t) * constants().size();
    pad_constants(64);
    codes_offset_ = sizeof(std::uint32_t) * constants().size();
    add_codes();

    const std::uint32_t globals = number(site.in[globals_input].width), m0 = number(op.op.layer.m0),
                        heads = number(op.op.layer.heads);
    number_pipeline_ = site.context.pipeline(
        shaders::cloud_coefficients_gradient,
        std::array{coefficients_gradient_group, number(c0_), number(c1_), globals, m0, heads});
    const std::uint32_t grad_input =
        (op.grad_input_at(means_input) >= 0 ? 1u : 0u) | (op.grad_input_at(globals_input) >= 0 ? 2u : 0u);
    if (grad_input)
      input_pipeline_ =
          site.context.pipeline(shaders::cloud_coefficients_inputs,
                                std::array{tile_rows, number(c0_), number(c1_), globals, grad_input});
    constant_pipeline_ =
        site.context.pipeline(shaders::cloud_coefficients_constants,
                              std::array{tile_rows, number(c0_), number(c1_), globals, m0, heads});
  }

  std::size_t scratch_bytes(const graph::BatchLayout& layout) const override {
    return 2 * numbers_bytes(layout.clouds());
  }

  void record(const Arguments& args) const override {
    const GradientSlots<ops::CloudCoefficients> slots{op_, args};
    const std::uint32_t clouds = args.layout.clouds();
    if (clouds > most_clouds)
      throw Failure(ErrorCode::unsupported, "a gradient over " + std::to_string(clouds) +
                                                " clouds; Vulkan takes up to " + std::to_string(most_clouds));
    const Range weights = args.constants.sub(0, weights_bytes_);
    const Range codes = args.constants.sub(codes_offset_, args.constants.size - codes_offset_);
    const Range numbers = args.scratch.sub(0, numbers_bytes(clouds));
    const Range d_numbers = args.scratch.sub(numbers_bytes(clouds), numbers_bytes(clouds));
    args.schedule.dispatch(
        number_pipeline_,
        {slots.in(means_input), slots.in(globals_input), weights, slots.grad_output(0), numbers, d_numbers},
        SegmentParameters{0, clouds}, {clouds, 1, 1}, cost_ * clouds);
    if (input_pipeline_)
      args.schedule.dispatch(input_pipeline_,
                             {d_numbers, slots.grad_input(means_input), slots.grad_input(globals_input)},
                             SegmentParameters{0, clouds}, {clouds, 1, 1}, 100.0 * clouds);
    const auto vectors = static_cast<std::uint32_t>(slots.constants().size / (4 * sizeof(float)));
    args.schedule.dispatch(constant_pipeline_, {codes, numbers, slots.grad_output(0), slots.constants()},
                           RowSumParameters{clouds, vectors},
                           {(4 * vectors + tile_rows - 1) / tile_rows, 1, 1}, 50.0 * vectors * clouds);
  }

 private:
  // The first shader's cost; throws where its loops or its shared numbers would be too many.
  void require() {
    const ops::PointAttention& layer = op_.op.layer;
    const auto rounds = [](int count) {
      return (count + int{coefficients_gradient_group} - 1) / int{coefficients_gradient_group};
    };
    const int from = c0_ + 1, numbers = extra_ + 3 * c1_;
    const int rows = layer.heads * (paths_ + extra_ + from) + layer.m0 * (1 + layer.heads);
    const int loops = rounds(numbers) + rounds(rows) * (4 + extra_) +
                      rounds(numbers) * (1 + rows + layer.heads * (1 + from) + layer.m0 * layer.heads);
    cost_ = 2.0 * coefficients_gradient_group * loops;
    if (static_cast<std::size_t>(numbers + 2 * rows) > coefficients_gradient_numbers ||
        static_cast<std::uint32_t>(loops) >= capabilities_.loop_limit)
      throw Failure(
          ErrorCode::unsupported,
          "the key points' last layer has too many channels for its gradient on " + capabilities_.name);
  }

  std::size_t numbers_bytes(std::uint32_t clouds) const {
    const std::size_t bytes = sizeof(float) * static_cast<std::size_t>(extra_ + 3 * c1_) * clouds;
    return scratch_aligned(bytes);
  }

  void add_code(Kind kind, int at, int column) {
    add_constant(kind << 16 | static_cast<std::uint32_t>(column));
    add_constant(static_cast<std::uint32_t>(at));
  }

  // In the order of ops::constants, whose matrices are column after column.
  void add_codes() {
    const ops::PointAttention& full = op_.op.full;
    const int n = full.n0(), z = full.c0 + 1, heads = full.heads, m0 = full.m0;
    const int zero_keys = heads * paths_, skip = zero_keys + heads * z, zero_values = skip + m0;
    const std::size_t first = constants().size();
    const auto nothing = [this](const Eigen::MatrixXd& matrix) {
      for (Eigen::Index i = 0; i < matrix.size(); ++i) add_code(none, 0, 0);
    };
    const auto appended = [&](int path) { return path >= c0_ && path < full.c0; };
    const auto own_path = [&](int path) { return path < c0_ ? path : path - extra_; };
    for (int column = 0; column < z; ++column)
      for (int r = 0; r < heads * n; ++r) {
        const int h = r / n, path = r % n;
        if (appended(path))
          add_code(negative_row, zero_keys + h * z + path, column);
        else
          add_code(row, h * paths_ + own_path(path), column);
      }
    nothing(full.M1);
    for (int column = 0; column < heads * n; ++column)
      for (int o = 0; o < m0; ++o) {
        const int h = column / n, path = column % n;
        if (appended(path))
          add_code(appended_value, o * heads + h, path - c0_);
        else
          add_code(value, o * heads + h, own_path(path));
      }
    nothing(full.O1);
    for (int column = 0; column < z; ++column)
      for (int o = 0; o < m0; ++o) add_code(row, skip + o, column);
    nothing(full.S1);
    for (int column = 0; column < z; ++column)
      for (int r = 0; r < heads * z; ++r) add_code(row, zero_keys + r, column);
    nothing(full.Mz1);
    for (int column = 0; column < heads * z; ++column)
      for (int o = 0; o < m0; ++o) add_code(row, zero_values + o * heads + column / z, column % z);
    nothing(full.Oz1);
    nothing(full.plane);
    if (constants().size() - first != 2 * ops::constant_count(op_.op))
      throw Failure(ErrorCode::internal, "cloud coefficients of an unknown shape");
    while ((constants().size() - first) % 8) add_code(none, 0, 0);
  }

  const ops::Gradient<ops::CloudCoefficients> op_;
  const Capabilities& capabilities_;
  const int c0_, c1_, extra_, paths_;
  std::size_t weights_bytes_ = 0, codes_offset_ = 0;
  double cost_ = 0;
  PipelineOf<SegmentParameters> number_pipeline_, input_pipeline_;
  PipelineOf<RowSumParameters> constant_pipeline_;
};

}  // namespace

template <>
KernelPtr make_kernel(const KernelContext& site, const ops::Gradient<ops::CloudCoefficients>& op) {
  return std::make_unique<CloudCoefficientsGradient>(site, op);
}

}  // namespace bitr::vk
