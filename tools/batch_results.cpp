#include "batch_results.hpp"

#include <algorithm>
#include <cmath>

#include "core/failure.hpp"

namespace bitr::tool {
namespace {

std::string line_of(const Json& json) { return json.dump(-1, ' ', false, Json::error_handler_t::replace); }

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
  if (const auto errors = line.find("errors"); errors != line.end())
    rotation_degrees.add(errors->value("rotation_degrees", 180.0));
  if (const auto diagnostics = line.find("diagnostics"); diagnostics != line.end())
    if (const auto share = diagnostics->find("overlap"); share != diagnostics->end() && share->is_number())
      overlap.add(share->get<double>());
  if (const auto judged = line.find("confidence"); judged != line.end())
    confidence.add(judged->value("value", 0.0));
  refused += line.contains("refused");
}

BatchResults::BatchResults(const std::string& file, const Json& settings)
    : head_(line_of(settings)), log_(file, [this](std::string_view line) {
        // What other settings made is kept as it is.
        if (other_settings_) return true;
        if (!headed_) {
          headed_ = line == head_;
          other_settings_ = !headed_;
          return true;
        }
        const Json json = Json::parse(line, nullptr, false);
        if (!json.is_object() || !json.contains("pair")) return false;
        summary_.add(json);
        return true;
      }) {
  if (other_settings_)
    throw Failure(ErrorCode::invalid_argument,
                  file + ": was made from another manifest or with other options; take another --out");
  if (!headed_) log_.append(head_ + "\n");
}

void BatchResults::append(const std::vector<Json>& lines) {
  std::string text;
  for (const Json& line : lines) text += line_of(line) + "\n";
  log_.append(text);
  for (const Json& line : lines) summary_.add(line);
}

}  // namespace bitr::tool
