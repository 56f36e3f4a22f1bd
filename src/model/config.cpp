#include "model/config.hpp"

#include <nlohmann/json.hpp>
#include <optional>

namespace bitr {
namespace {

struct Field {
  const char* name;  ///< official argument name
  int ModelConfig::*value;
  int low, high;
};

constexpr Field fields[] = {
    {"num_channels", &ModelConfig::num_channels, 1, 256},
    {"predict_head", &ModelConfig::predict_head, 1, 64},
    {"num_layers", &ModelConfig::num_layers, 0, 16},
    {"feature_num_layers", &ModelConfig::feature_num_layers, 0, 16},
    {"feature_max_deg", &ModelConfig::feature_max_deg, 1, 1},
    {"feature_num_channels", &ModelConfig::feature_num_channels, 1, 256},
    {"div", &ModelConfig::div, 1, 64},
    {"head", &ModelConfig::heads, 1, 64},
    {"k_neighbor", &ModelConfig::k_neighbor, 1, 64},
    {"re_convert_k", &ModelConfig::re_convert_k, 1, 64},
    {"num_key_points", &ModelConfig::num_key_points, 2, 1024},
    {"key_mean_num", &ModelConfig::key_mean_num, 1, 64},
    {"key_global_merge_coe", &ModelConfig::key_global_merge_coe, 1, 256},
    {"neighbor_dilation", &ModelConfig::neighbor_dilation, 1, 16},
};

struct Switch {
  const char* name;
  bool ModelConfig::*value;
};

constexpr Switch switches[] = {{"return_normals", &ModelConfig::return_normals},
                               {"get_color", &ModelConfig::get_color},
                               {"relu_square", &ModelConfig::relu_square},
                               {"centroid_offset", &ModelConfig::centroid_offset}};

}  // namespace

Result<void> validate(const ModelConfig& config) {
  for (const Field& field : fields) {
    const int value = config.*field.value;
    if (value < field.low || value > field.high)
      return fail(ErrorCode::invalid_argument, std::string(field.name) + " is " + std::to_string(value) +
                                                   ", must be " + std::to_string(field.low) + " … " +
                                                   std::to_string(field.high));
  }
  const auto split = [&](const char* name, int channels) -> Result<void> {
    const int values = channels / config.div;
    if (values < 1 || values % config.heads != 0)
      return fail(ErrorCode::invalid_argument,
                  std::string(name) + " / div is " + std::to_string(channels) + " / " +
                      std::to_string(config.div) +
                      ", which must be a positive multiple of head = " + std::to_string(config.heads));
    return {};
  };
  if (config.re_convert_k >= config.num_key_points)
    return fail(ErrorCode::invalid_argument,
                "re_convert_k is " + std::to_string(config.re_convert_k) +
                    ", must be below num_key_points = " + std::to_string(config.num_key_points));
  if (auto ok = split("feature_num_channels", config.feature_num_channels); !ok) return ok;
  if (auto ok = split("num_key_points", config.num_key_points); !ok) return ok;
  if (config.num_layers > 0)
    if (auto ok = split("num_channels", config.num_channels); !ok) return ok;
  return {};
}

namespace model {

std::string to_json(const ModelConfig& config) {
  nlohmann::json json;
  for (const Field& field : fields) json[field.name] = config.*field.value;
  for (const Switch& option : switches) json[option.name] = config.*option.value;
  return json.dump();
}

namespace {

// Never a whole document: printing one recurses as deep as it is nested.
std::string shown(const nlohmann::json& value) {
  constexpr std::size_t most = 60;
  if (value.is_structured()) return value.type_name();
  const std::string text = value.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  return text.size() <= most ? text : text.substr(0, most) + "…";
}

}  // namespace

Result<ModelConfig> config_from_json(std::string_view text, const std::string& file) {
  const auto json = nlohmann::json::parse(text, nullptr, false);
  if (!json.is_object())
    return fail(ErrorCode::bad_file, file + ": metadata bitr.config is not a JSON object");
  ModelConfig config;
  const auto wrong = [&](const char* name) {
    return fail(ErrorCode::bad_file,
                file + ": bitr.config." + name + " is " + shown(json[name]) + ", not a number");
  };
  for (const Field& field : fields) {
    if (!json.contains(field.name)) continue;
    const auto& value = json[field.name];
    if (!value.is_number_integer() || value < field.low || value > field.high)
      return fail(ErrorCode::bad_file, file + ": bitr.config." + field.name + " is " + shown(value) +
                                           ", must be " + std::to_string(field.low) + " … " +
                                           std::to_string(field.high));
    config.*field.value = value.get<int>();
  }
  for (const Switch& option : switches) {
    if (!json.contains(option.name)) continue;
    const auto& value = json[option.name];
    if (value.is_boolean())
      config.*option.value = value.get<bool>();
    else if (value.is_number_integer())
      config.*option.value = value != 0;
    else
      return wrong(option.name);
  }
  if (auto ok = validate(config); !ok)
    return fail(ErrorCode::bad_file, file + ": bitr.config: " + ok.error().message);
  return config;
}

namespace {

// The highest i for which prefix + i + suffix names a tensor; −1 if none.
int last_index(const Shapes& shapes, const std::string& prefix, const std::string& suffix) {
  int last = -1;
  for (int i = 0; i < 64; ++i)
    if (shapes.count(prefix + std::to_string(i) + suffix)) last = i;
  return last;
}

}  // namespace

Result<ModelConfig> infer_config(const Shapes& shapes, const std::string& file) {
  ModelConfig config;
  std::string missing;
  const auto shape = [&](const std::string& name, std::size_t axis) -> int {
    const auto it = shapes.find(name);
    if (it == shapes.end() || it->second.size() != 2 || it->second[axis] > 4096 || it->second[axis] == 0) {
      if (missing.empty()) missing = name;
      return 1;
    }
    return static_cast<int>(it->second[axis]);
  };
  const std::string fe = "feature_extract.Gblock.", key = "feature_extract.key_layer.", bi = "Binet.Gblock.";
  const std::string scalar = "transform.(0, 0)";

  const std::string query = fe + "0.GMAB.q.transform.";
  config.get_color = shape(query + "(0, 0)", 1) == 3;
  config.return_normals = shapes.count(query + "(1, 0)") != 0 && shape(query + "(1, 0)", 1) == 1;
  config.feature_num_layers = last_index(shapes, fe, ".project.1." + scalar) / 2;
  config.feature_num_channels = shape(key + "key_extract.project.1." + scalar, 0);
  config.div = config.feature_num_channels / shape(key + "key_extract.GMAB.q." + scalar, 0);
  config.num_key_points = shape(key + "key_regress.project.1." + scalar, 0);
  config.key_global_merge_coe = shape(key + "key_feature_gloabal_pool_weight.project.1." + scalar, 0) - 1;
  config.num_layers = last_index(shapes, bi, ".project.0." + scalar) / 2;
  if (config.num_layers > 0) config.num_channels = shape(bi + "0.project.1." + scalar, 0);
  config.predict_head = shape("predict_head.linear_head.transform.(1, 1)", 1);
  if (!missing.empty())
    return fail(ErrorCode::bad_file,
                file + ": not a BITR state dict: tensor " + missing + " is missing or misshapen");
  // Fewer key points than neighbours can only mean that the file was made with fewer neighbours.
  if (config.re_convert_k >= config.num_key_points) config.re_convert_k = config.num_key_points - 1;
  if ((config.feature_num_channels / config.div) % config.heads != 0) config.heads = 1;
  if (auto ok = validate(config); !ok)
    return fail(ErrorCode::bad_file, file + ": configuration implied by the shapes: " + ok.error().message);
  return config;
}

}  // namespace model
}  // namespace bitr
