// The official state dict for a configuration: every trainable tensor, every alias, every buffer.
#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include "model/architecture.hpp"

namespace bitr::model {

enum class Initialisation {
  kaiming_uniform,  ///< U(±√(6/fan_in))
  bias_uniform,     ///< U(±1/√fan_in)
  normal,           ///< randn · scale
  one,
  zero,
};

struct ParameterSpec {
  std::string name;
  std::vector<std::size_t> shape;
  Initialisation init = Initialisation::zero;
  double scale = 1;  ///< fan_in, or the factor of `normal`
};

struct StateDict {
  std::vector<ParameterSpec> parameters;       ///< canonical, in the official order of construction
  std::map<std::string, std::string> aliases;  ///< alias → canonical name
  std::set<std::string> buffers;               ///< names that may be present and are not read
};

StateDict state_dict(const ModelConfig& config);

}  // namespace bitr::model
