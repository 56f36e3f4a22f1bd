#include "model/load.hpp"

#include <cmath>

#include "model/config.hpp"
#include "model/parameters.hpp"

namespace bitr::model {
namespace {

constexpr const char *config_key = "bitr.config", *mode_key = "bitr.mode", *trained_key = "bitr.trained";

std::string to_string(const std::vector<std::size_t>& shape) {
  std::string text = "[";
  for (std::size_t i = 0; i < shape.size(); ++i) text += (i ? ", " : "") + std::to_string(shape[i]);
  return text + "]";
}

Result<ModelConfig> config_of(const TensorMap& map, const std::string& file) {
  if (const auto it = map.metadata.find(config_key); it != map.metadata.end())
    return config_from_json(it->second, file);
  Shapes shapes;
  for (const auto& [name, tensor] : map.tensors) shapes[name] = tensor.shape;
  return infer_config(shapes, file);
}

Result<Mode> mode_of(const TensorMap& map, const ModelOptions& options) {
  if (options.mode) return *options.mode;
  const auto it = map.metadata.find(mode_key);
  if (it == map.metadata.end() || it->second == "reference") return Mode::reference;
  if (it->second == "scale-exact") return Mode::scale_exact;
  return fail(ErrorCode::bad_file, options.name + ": metadata " + mode_key + " is \"" + it->second +
                                       "\", must be \"scale-exact\" or \"reference\"");
}

Result<Eigen::MatrixXd> matrix_from(const Tensor& tensor, const ParameterSpec& spec,
                                    const std::string& file) {
  if (tensor.shape != spec.shape)
    return fail(ErrorCode::bad_file, file + ": tensor " + spec.name + " has shape " +
                                         to_string(tensor.shape) + ", must be " + to_string(spec.shape));
  if (tensor.type != DType::f32 && tensor.type != DType::f64 && tensor.type != DType::f16 &&
      tensor.type != DType::bf16)
    return fail(ErrorCode::bad_file, file + ": tensor " + spec.name + " has type " +
                                         std::string(name(tensor.type)) + ", must be a floating-point type");
  const auto values = tensor.to_double();
  for (std::size_t i = 0; i < values.size(); ++i)
    if (!std::isfinite(values[i]))
      return fail(ErrorCode::bad_file, file + ": tensor " + spec.name +
                                           " holds a non-finite number at element " + std::to_string(i));
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const auto rows = static_cast<Eigen::Index>(spec.shape[0]);
  const auto cols = spec.shape.size() == 2 ? static_cast<Eigen::Index>(spec.shape[1]) : 1;
  return Eigen::MatrixXd(Eigen::Map<const RowMajor>(values.data(), rows, cols));
}

}  // namespace

Result<Weights> weights_from_tensors(const TensorMap& map, const ModelOptions& options) {
  const std::string& file = options.name;
  const auto config = config_of(map, file);
  if (!config) return tl::unexpected(config.error());
  const auto mode = mode_of(map, options);
  if (!mode) return tl::unexpected(mode.error());

  Weights weights{
      .config = *config, .mode = *mode, .name = file, .trained = true, .parameters = {}, .metadata = {}};
  weights.metadata = map.metadata;
  if (const auto it = map.metadata.find(trained_key); it != map.metadata.end())
    weights.trained = it->second == "true";

  const StateDict dict = state_dict(*config);
  std::map<std::string, const Tensor*> found;  // canonical name → the tensor that was seen first
  for (const auto& [tensor_name, tensor] : map.tensors) {
    const auto alias = dict.aliases.find(tensor_name);
    const std::string& canonical = alias == dict.aliases.end() ? tensor_name : alias->second;
    const auto [it, is_new] = found.emplace(canonical, &tensor);
    if (!is_new && (it->second->shape != tensor.shape || it->second->type != tensor.type ||
                    it->second->bytes != tensor.bytes))
      return fail(ErrorCode::bad_file, file + ": tensor " + tensor_name + " disagrees with " + canonical +
                                           ", of which it is an alias");
  }
  for (const ParameterSpec& spec : dict.parameters) {
    const auto it = found.find(spec.name);
    if (it == found.end()) return fail(ErrorCode::bad_file, file + ": tensor " + spec.name + " is missing");
    auto matrix = matrix_from(*it->second, spec, file);
    if (!matrix) return tl::unexpected(matrix.error());
    weights.parameters.emplace(spec.name, std::move(*matrix));
    found.erase(it);
  }
  for (const auto& [tensor_name, tensor] : found)
    if (!dict.buffers.count(tensor_name))
      return fail(ErrorCode::bad_file,
                  file + ": tensor " + tensor_name + " does not belong to this configuration");
  return weights;
}

TensorMap tensors_from_weights(const Weights& weights, WeightPrecision precision) {
  TensorMap map;
  map.metadata = weights.metadata;
  map.metadata[config_key] = to_json(weights.config);
  map.metadata[mode_key] = weights.mode == Mode::scale_exact ? "scale-exact" : "reference";
  map.metadata[trained_key] = weights.trained ? "true" : "false";
  for (const ParameterSpec& spec : state_dict(weights.config).parameters) {
    const Eigen::MatrixXd& matrix = weights.parameters.at(spec.name);
    std::vector<float> values;
    for (Eigen::Index i = 0; i < matrix.rows(); ++i)
      for (Eigen::Index j = 0; j < matrix.cols(); ++j) values.push_back(static_cast<float>(matrix(i, j)));
    map.tensors.emplace(spec.name, precision == WeightPrecision::f16 ? Tensor::half(spec.shape, values)
                                                                     : Tensor::from(spec.shape, values));
  }
  return map;
}

}  // namespace bitr::model
