#include <bitr/io.hpp>
#include <bitr/model.hpp>
#include <charconv>

#include "api/internal.hpp"
#include "core/guarded.hpp"
#include "io/safetensors.hpp"
#include "io/torch_checkpoint.hpp"
#include "model/load.hpp"
#include "model/parameters.hpp"

namespace bitr {
namespace {

// `options.name` labels errors; the model is then called `name`.
Result<Model> make_model(const Result<TensorMap>& map, const ModelOptions& options, std::string name) {
  if (!map) return tl::unexpected(map.error());
  auto weights = model::weights_from_tensors(*map, options);
  if (!weights) return tl::unexpected(weights.error());
  weights->name = std::move(name);
  return Internal::model(std::make_shared<const model::Weights>(std::move(*weights)));
}

template <class Parse>
Result<Model> read_model(const std::filesystem::path& path, const ModelOptions& options, Parse parse) {
  return guarded([&]() -> Result<Model> {
    const auto bytes = io::read_file(path);
    if (!bytes) return tl::unexpected(bytes.error());
    return make_model(parse(*bytes, path.string()), {.name = path.string(), .mode = options.mode},
                      path.stem().string());
  });
}

}  // namespace

const ModelConfig& Model::config() const { return weights_->config; }
Mode Model::mode() const { return weights_->mode; }
const std::string& Model::name() const { return weights_->name; }
bool Model::trained() const { return weights_->trained; }
std::size_t Model::tensor_count() const { return weights_->parameters.size(); }
std::optional<PointRange> Model::trained_points() const {
  const auto number = [&](const char* key) -> std::size_t {
    const auto found = weights_->metadata.find(key);
    std::size_t value = 0;
    if (found != weights_->metadata.end())
      std::from_chars(found->second.data(), found->second.data() + found->second.size(), value);
    return value;
  };
  const PointRange range{number("bitr.cloud_points_low"), number("bitr.cloud_points_high")};
  if (range.low == 0 || range.high < range.low) return std::nullopt;
  return range;
}
std::size_t Model::parameter_count() const {
  std::size_t total = 0;
  for (const auto& [name, matrix] : weights_->parameters) total += static_cast<std::size_t>(matrix.size());
  return total;
}

Result<Model> load_model(std::span<const std::byte> safetensors, const ModelOptions& options) {
  return guarded(
      [&] { return make_model(io::parse_safetensors(safetensors, options.name), options, options.name); });
}

Result<Model> load_model(const std::filesystem::path& path, const ModelOptions& options) {
  return read_model(path, options, io::parse_safetensors);
}

Result<Model> load_torch_checkpoint(const std::filesystem::path& path, const ModelOptions& options) {
  return read_model(path, options, io::parse_torch_checkpoint);
}

Result<Model> untrained_model(const ModelConfig& config, std::uint64_t seed, Mode mode) {
  if (auto ok = validate(config); !ok) return tl::unexpected(ok.error());
  return guarded([&]() -> Result<Model> {
    return Internal::model(
        std::make_shared<const model::Weights>(model::initial_weights(config, seed, mode)));
  });
}

std::vector<std::byte> serialize(const Model& model, WeightPrecision precision) {
  return io::serialize_safetensors(model::tensors_from_weights(Internal::weights(model), precision));
}

}  // namespace bitr
