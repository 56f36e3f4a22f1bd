// The configuration as JSON (official argument names) and as implied by the shapes of a state dict.
#pragma once

#include <bitr/model.hpp>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace bitr::model {

std::string to_json(const ModelConfig& config);

/// Missing fields keep their defaults; `bad_file` names an unknown type or a value out of range.
Result<ModelConfig> config_from_json(std::string_view json, const std::string& file);

using Shapes = std::map<std::string, std::vector<std::size_t>>;

/// What shapes cannot tell (heads, neighbour counts) takes the official defaults.
Result<ModelConfig> infer_config(const Shapes& shapes, const std::string& file);

}  // namespace bitr::model
