#include "batch_results.hpp"

#include <algorithm>
#include <cmath>

#include "core/failure.hpp"

namespace bitr::tool {
namespace {

std::string line_of(const Json& json) { return json.dump(-1, ' ', false, Json::error_handler_t::replace); }

/// Whether the line is the head of some batch's results.
bool is_head(std::string_view line) {
  const Json json = Json::parse(line, nullptr, false);
  return json.is_object() && json.contains("manifest") && json.contains("manifest_fingerprint");
}

/// The number under `key` of the object under `outer`; null where either is not there.
Json number_under(const Json& line, const char* outer, const char* key) {
  const auto object = line.find(outer);
  if (object == line.end() || !object->is_object()) return nullptr;
  const auto number = object->find(key);
  return number != object->end() && number->is_number() ? *number : Json(nullptr);
}

/// Why it is not what append() writes for that pair; empty when it may be.
std::string problem_of(const Json& line, std::uint64_t pair) {
  if (!line.is_object()) return "is no JSON object";
  const auto has = [&](const char* key, auto is) {
    const auto found = line.find(key);
    return found != line.end() && ((*found).*is)();
  };
  if (!has("pair", &Json::is_number_unsigned)) return "has no number of a pair";
  if (line["pair"] != pair) return "is of pair " + line["pair"].dump();
  for (const char* key : {"name", "source", "reference", "status"})
    if (!has(key, &Json::is_string)) return "has no \"" + std::string(key) + "\"";
  const auto& status = line["status"].get_ref<const std::string&>();
  const bool posed = status == "ok" || status == "degenerate";
  if (!posed && status != "failed" && status != "unreadable") return "has a status that there is not";
  if (posed && !has("transform", &Json::is_array)) return "has no \"transform\"";
  if (posed && !has("diagnostics", &Json::is_object)) return "has no \"diagnostics\"";
  if (line.contains("errors") && number_under(line, "errors", "rotation_degrees").is_null())
    return "has \"errors\" without \"rotation_degrees\"";
  if (line.contains("confidence") && !line["confidence"].is_number())
    return "has a \"confidence\" that is no number";
  return {};
}

}  // namespace

void Histogram::add(double value) {
  const double share = std::clamp(value / most_, 0.0, 1.0);
  ++bins_[static_cast<std::size_t>(std::lround(share * static_cast<double>(bins_.size() - 1)))];
  sum_ += value;
  ++count_;
}

double Histogram::median() const {
  std::uint64_t below = 0;
  for (std::size_t i = 0; i < bins_.size(); ++i)
    if (below += bins_[i]; 2 * below >= count_ && below > 0)
      return most_ * static_cast<double>(i) / static_cast<double>(bins_.size() - 1);
  return 0;
}

double Histogram::share_within(double value) const {
  std::uint64_t within = 0;
  for (std::size_t i = 0; i < bins_.size(); ++i)
    if (most_ * static_cast<double>(i) <= value * static_cast<double>(bins_.size() - 1)) within += bins_[i];
  return count_ ? static_cast<double>(within) / static_cast<double>(count_) : 0;
}

void BatchSummary::add(const Json& line) {
  ++pairs;
  const std::string status = line.value("status", "");
  ++(status == "ok" ? ok : status == "degenerate" ? degenerate : status == "failed" ? failed : unreadable);
  const auto take = [&](const char* outer, const char* key, Histogram& values) {
    if (const Json number = number_under(line, outer, key); !number.is_null())
      values.add(number.get<double>());
  };
  take("errors", "rotation_degrees", rotation_degrees);
  take("diagnostics", "overlap", overlap);
  if (const auto given = line.find("confidence"); given != line.end() && given->is_number())
    confidence.add(given->get<double>());
  refused += line.contains("refused");
}

BatchResults::BatchResults(const std::string& file, const Json& settings,
                           std::function<std::uint64_t(std::uint64_t)> number)
    : file_(file),
      head_(line_of(settings)),
      number_(std::move(number)),
      log_(file, [this](std::string_view line, bool whole) { return take_up(line, whole); }) {
  if (!headed_) log_.append(head_ + "\n");
}

bool BatchResults::take_up(std::string_view line, bool whole) {
  const auto refuse = [&](const std::string& why) {
    throw Failure(ErrorCode::invalid_argument,
                  file_ + ": " + why + "; take another --out, or remove the file");
  };
  if (!headed_) {
    // A killed process leaves a part of it at most.
    if (!whole && head_.starts_with(line)) return false;
    headed_ = line == head_;
    if (!headed_ && !is_head(line)) refuse("does not begin as the results of a batch do");
    if (!headed_) refuse("was made from another manifest, with another model or with other options");
    return true;
  }
  if (!whole) return false;
  const std::uint64_t expected = number_(summary_.pairs);
  const Json json = Json::parse(line, nullptr, false);
  if (const std::string problem = problem_of(json, expected); !problem.empty())
    refuse("line " + std::to_string(summary_.pairs + 2) + ", where that of pair " + std::to_string(expected) +
           " belongs, " + problem);
  summary_.add(json);
  return true;
}

void BatchResults::append(const std::vector<Json>& lines) {
  std::string text;
  for (const Json& line : lines) text += line_of(line) + "\n";
  log_.append(text);
  for (const Json& line : lines) summary_.add(line);
}

}  // namespace bitr::tool
