#include "api/doctor.hpp"

#include "core/guarded.hpp"

namespace bitr {

Result<std::vector<Check>> run_doctor(const Device& device) {
  return guarded([&]() -> Result<std::vector<Check>> {
    const auto model = untrained_model();
    // As many neighbours and channels as the models that ship have.
    const auto shipped =
        untrained_model({.feature_num_channels = 8, .neighbor_dilation = 4, .relu_square = true});
    if (!model) return tl::unexpected(model.error());
    if (!shipped) return tl::unexpected(shipped.error());
    const std::vector<RandomPair> pairs = doctor_pairs(*model);
    const std::vector<std::vector<RandomPair>> batches = large_batches();
    std::vector<OperationsRun> runs = {{*model, Mode::scale_exact, pairs}, {*model, Mode::reference, pairs}};
    for (const auto& batch : batches) {
      runs.push_back({*model, Mode::scale_exact, batch});
      runs.push_back({*shipped, Mode::scale_exact, batch});
    }
    std::vector<Check> checks;
    check_operations(device, runs, checks);
    check_passes(device, *model, pairs, checks);
    check_refinement(device, checks);
    return checks;
  });
}

}  // namespace bitr
