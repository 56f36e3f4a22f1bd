#include "vk/row_sums.hpp"

#include "core/failure.hpp"
#include "row_sums.spv.hpp"

namespace bitr::vk {
namespace {

constexpr std::uint32_t most_rows = 65534;

}  // namespace

RowSums::RowSums(const Context& context)
    : pipeline_(context.pipeline(shaders::row_sums, std::array{tile_rows})) {}

void RowSums::record(Schedule& schedule, const Range& addends, std::uint32_t rows, const Range& sum) const {
  if (rows > most_rows)
    throw Failure(ErrorCode::unsupported, "a gradient's sum over " + std::to_string(rows) +
                                              " clouds or pairs; Vulkan takes up to " +
                                              std::to_string(most_rows));
  const auto vectors = static_cast<std::uint32_t>(sum.size / (4 * sizeof(float)));
  schedule.dispatch(pipeline_, {addends, sum}, RowSumParameters{rows, vectors},
                    {(vectors + tile_rows - 1) / tile_rows, 1, 1}, 16.0 * rows * vectors);
}

}  // namespace bitr::vk
