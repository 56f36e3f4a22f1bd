#include "train/checkpoint.hpp"

#include <cmath>
#include <nlohmann/json.hpp>

#include "core/guarded.hpp"
#include "io/safetensors.hpp"

namespace bitr::train {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char *options_key = "bitr.training", *state_key = "bitr.checkpoint";

std::vector<double> read_vector(const TensorMap& map, const char* name, std::size_t size,
                                const std::string& file) {
  const auto found = map.tensors.find(name);
  const auto broken = [&](const std::string& what) {
    throw Failure(ErrorCode::bad_file, file + ": tensor " + name + " " + what);
  };
  if (found == map.tensors.end()) broken("is missing: this is no checkpoint of a training run");
  const Tensor& tensor = found->second;
  if (tensor.type != DType::f64 || tensor.shape.size() != 1) broken("is not a row of F64 numbers");
  if (size != 0 && tensor.size() != size)
    broken("has " + std::to_string(tensor.size()) + " numbers, must have " + std::to_string(size));
  std::vector<double> values = tensor.to_double();
  for (const double x : values)
    if (!std::isfinite(x)) broken("holds a non-finite number");
  return values;
}

}  // namespace

std::vector<std::byte> serialize(const Checkpoint& checkpoint) {
  const TrainState& s = checkpoint.state;
  TensorMap map;
  for (const auto& [name, values] : {std::pair{"weights", &s.weights},
                                     {"adam.first", &s.adam.first},
                                     {"adam.second", &s.adam.second},
                                     {"average", &s.average}})
    map.tensors.emplace(name, Tensor::from({values->size()}, *values));
  map.metadata[options_key] = to_json(checkpoint.options);
  Json json = {
      {"step", s.step},
      {"updates", s.adam.updates},
      {"skipped_steps", s.skipped_steps},
      {"skipped_in_row", s.skipped_in_row},
      {"skipped_samples", s.skipped_samples},
      {"data",
       {{"epoch", s.position.epoch}, {"index", s.position.index}, {"fingerprint", s.position.fingerprint}}},
      {"best_score", s.best_score ? Json(*s.best_score) : Json()},
      {"best_step", s.best_step},
      {"validations_since_best", s.validations_since_best},
      {"seconds", s.seconds}};
  map.metadata[state_key] = json.dump();
  return io::serialize_safetensors(map);
}

Result<Checkpoint> parse_checkpoint(std::span<const std::byte> bytes, const std::string& file) {
  return guarded([&]() -> Result<Checkpoint> {
    const auto map = io::parse_safetensors(bytes, file);
    if (!map) return tl::unexpected(map.error());
    Checkpoint checkpoint;
    TrainState& s = checkpoint.state;
    s.weights = read_vector(*map, "weights", 0, file);
    s.adam.first = read_vector(*map, "adam.first", s.weights.size(), file);
    s.adam.second = read_vector(*map, "adam.second", s.weights.size(), file);
    s.average = read_vector(*map, "average", s.weights.size(), file);
    const auto metadata = [&](const char* key) {
      const auto found = map->metadata.find(key);
      if (found == map->metadata.end())
        throw Failure(ErrorCode::bad_file, file + ": metadata " + key + " is missing");
      return found->second;
    };
    auto options = parse_train_options(metadata(options_key), file + ": metadata " + options_key);
    if (!options) return fail(ErrorCode::bad_file, options.error().message);
    checkpoint.options = std::move(*options);
    try {
      const Json json = Json::parse(metadata(state_key));
      s.step = json.at("step").get<std::uint64_t>();
      s.adam.updates = json.at("updates").get<std::uint64_t>();
      s.skipped_steps = json.at("skipped_steps").get<std::uint64_t>();
      s.skipped_in_row = json.at("skipped_in_row").get<std::uint64_t>();
      s.skipped_samples = json.at("skipped_samples").get<std::uint64_t>();
      const Json& data = json.at("data");
      s.position = {data.at("epoch").get<std::uint64_t>(), data.at("index").get<std::uint64_t>(),
                    data.at("fingerprint").get<std::uint64_t>()};
      if (!json.at("best_score").is_null()) s.best_score = json.at("best_score").get<double>();
      s.best_step = json.at("best_step").get<std::uint64_t>();
      s.validations_since_best = json.at("validations_since_best").get<std::uint64_t>();
      s.seconds = json.at("seconds").get<double>();
    } catch (const Json::exception& error) {
      return fail(ErrorCode::bad_file, file + ": metadata " + state_key + ": " + error.what());
    }
    return checkpoint;
  });
}

}  // namespace bitr::train
