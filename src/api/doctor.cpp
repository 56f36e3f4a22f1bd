#include "api/doctor.hpp"

#include "core/guarded.hpp"

namespace bitr {

Result<std::vector<Check>> run_doctor(const Device& device) {
  return guarded([&]() -> Result<std::vector<Check>> {
    const auto model = untrained_model();
    if (!model) return tl::unexpected(model.error());
    const std::vector<RandomPair> pairs = doctor_pairs(*model);
    std::vector<Check> checks;
    check_operations(device, *model, pairs, checks);
    check_passes(device, *model, pairs, checks);
    return checks;
  });
}

}  // namespace bitr
