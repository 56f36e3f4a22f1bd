#include "train/metrics.hpp"

namespace bitr::train {
namespace {

using Json = nlohmann::ordered_json;

}  // namespace

Metrics::Metrics(const std::filesystem::path& file, std::size_t step)
    : log_(file, [&](std::string_view line, bool whole) {
        if (!whole) return false;
        const Json json = Json::parse(line, nullptr, false);
        return json.is_object() && json.contains("step") && json["step"].is_number_unsigned() && step > 0 &&
               json["step"].get<std::size_t>() <= step && remember(json);
      }) {}

bool Metrics::remember(const Json& json) {
  try {
    const auto step = json.at("step").get<std::size_t>();
    if (json.contains("validation")) {
      ValidationResult result{.step = step,
                              .groups = {},
                              .score = json.at("score").get<double>(),
                              .best = json.at("best").get<bool>()};
      for (const Json& group : json.at("validation")) {
        ValidationGroup one{group.at("name").get<std::string>(), {}};
        one.errors.rotation.median = group.at("rotation_median").get<double>();
        one.errors.translation.median = group.at("translation_median").get<double>();
        result.groups.push_back(std::move(one));
      }
      history_.validations.push_back(std::move(result));
    } else if (!json.at("rotation").is_null()) {
      history_.losses.push_back({step, json.at("rotation").get<double>(),
                                 json.at("translation").get<double>(), json.at("spread").get<double>()});
    }
    return true;
  } catch (const Json::exception&) {
    return false;
  }
}

void Metrics::write(const Json& json) {
  log_.append(json.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n");
}

void Metrics::add(const Measured& loss, const Json& more) {
  Json json = {{"step", loss.step},
               {"loss", loss.rotation + loss.translation + loss.spread},
               {"rotation", loss.rotation},
               {"translation", loss.translation},
               {"spread", loss.spread}};
  json.update(more);
  write(json);
  remember(json);
}

void Metrics::add(const ValidationResult& validation, const Json& more) {
  Json groups = Json::array();
  for (const ValidationGroup& group : validation.groups) {
    const ErrorSummary& e = group.errors;
    groups.push_back({{"name", group.name},
                      {"pairs", e.pairs},
                      {"rotation_median", e.rotation.median},
                      {"rotation_mean", e.rotation.mean},
                      {"translation_median", e.translation.median},
                      {"translation_mean", e.translation.mean},
                      {"success_5", e.success_5},
                      {"success_15", e.success_15},
                      {"recall_5", e.recall_5},
                      {"recall_10", e.recall_10},
                      {"recall_20", e.recall_20},
                      {"flips", e.flips}});
  }
  Json json = {{"step", validation.step},
               {"score", validation.score},
               {"best", validation.best},
               {"validation", std::move(groups)}};
  json.update(more);
  write(json);
  remember(json);
}

}  // namespace bitr::train
