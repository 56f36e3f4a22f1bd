#include "train/metrics.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <bitr/io.hpp>
#include <cerrno>
#include <system_error>

#include "api/guarded.hpp"
#include "core/failure.hpp"

namespace bitr::train {
namespace {

using Json = nlohmann::ordered_json;

[[noreturn]] void refuse(const std::filesystem::path& file, const char* what) {
  throw Failure(ErrorCode::io, file.string() + ": cannot " + what + ": " +
                                   std::error_code(errno, std::generic_category()).message());
}

}  // namespace

Metrics::Metrics(std::filesystem::path file, std::size_t step) : file_(std::move(file)) {
  std::string kept;
  if (step > 0 && std::filesystem::exists(file_)) {
    const auto bytes = value_or_throw(io::read_file(file_));
    const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    for (std::size_t at = 0; at < text.size();) {
      const std::size_t end = text.find('\n', at);
      if (end == std::string_view::npos) break;
      const std::string_view line = text.substr(at, end - at);
      at = end + 1;
      const Json json = Json::parse(line, nullptr, false);
      if (!json.is_object() || !json.contains("step") || !json["step"].is_number_unsigned() ||
          json["step"].get<std::size_t>() > step)
        continue;
      if (remember(json)) kept += std::string(line) + '\n';
    }
  }
  value_or_throw(io::write_file(file_, std::as_bytes(std::span(kept))));
  descriptor_ = ::open(file_.c_str(), O_WRONLY | O_APPEND | O_CLOEXEC);
  if (descriptor_ < 0) refuse(file_, "open for writing");
}

Metrics::~Metrics() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

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
  const std::string line = json.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
  std::string_view rest = line;
  while (!rest.empty()) {
    const ssize_t written = ::write(descriptor_, rest.data(), rest.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) refuse(file_, "write");
    rest.remove_prefix(static_cast<std::size_t>(written));
  }
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
