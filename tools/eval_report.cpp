#include "eval_report.hpp"

#include <algorithm>
#include <charconv>

namespace bitr::tool {
namespace {

constexpr double bin_width = 0.2;
constexpr int bins = 5;

int bin_of(double overlap) { return std::clamp(static_cast<int>(overlap / bin_width), 0, bins - 1); }

ErrorSummary summarise_bin(const EvalMethod& method, std::optional<int> bin) {
  std::vector<PoseErrors> errors;
  for (const EvalPair& pair : method.pairs)
    if (!bin || bin_of(pair.overlap) == *bin) errors.push_back(pair.errors);
  return summarise(errors);
}

void add_judgements(const EvalMethod& method, std::optional<int> bin, std::vector<Judgement>& judgements) {
  for (const EvalPair& pair : method.pairs)
    if (pair.confidence && (!bin || bin_of(pair.overlap) == *bin))
      judgements.push_back({pair.confidence->value, near_truth(pair.errors)});
}

ConfidenceSummary confidence_of(const EvalMethod& method, std::optional<int> bin) {
  std::vector<Judgement> judgements;
  add_judgements(method, bin, judgements);
  return summarise_confidence(judgements);
}

/// The shortest text that reads back as the same number.
std::string text_of(double value) {
  char text[32];
  return {text, std::to_chars(text, text + sizeof text, value).ptr};
}

/// Padded by characters, not bytes.
std::string padded(const std::string& text, std::size_t width) {
  const auto length = static_cast<std::size_t>(
      std::count_if(text.begin(), text.end(), [](char c) { return (c & 0xc0) != 0x80; }));
  return text + std::string(width > length ? width - length : 0, ' ');
}

void print(const EvalRow& row, std::FILE* out) {
  const ErrorSummary& s = row.summary;
  const Distribution &r = s.rotation, &t = s.translation, &f = s.translation_fraction;
  std::fprintf(
      out,
      "%7.2f ±%5.2f %7.2f %7.2f |%7.4f %7.4f %7.4f %7.4f | %5.1f %5.1f | %5.1f %5.1f %5.1f | %5.1f | %7.1f",
      r.median, r.median_error, r.mean, r.std, t.median, t.mean, t.std, f.median, 100 * s.success_5,
      100 * s.success_15, 100 * s.recall_5, 100 * s.recall_10, 100 * s.recall_20, 100 * s.flips,
      row.milliseconds);
  if (s.failed > 0) std::fprintf(out, "  %zu failed", s.failed);
  std::fputc('\n', out);
}

Json to_json(const Distribution& d) {
  return {{"mean", d.mean}, {"std", d.std}, {"median", d.median}, {"median_error", d.median_error}};
}

Json to_json(const ConfidenceSummary& c) {
  Json reliability = Json::array();
  for (const ConfidenceBin& bin : c.bins)
    reliability.push_back(
        {{"low", bin.low}, {"high", bin.high}, {"poses", bin.poses}, {"said", bin.said}, {"was", bin.was}});
  return {{"roc_area", optional_json(c.area)},
          {"said", c.said},
          {"was", c.was},
          {"reliability", std::move(reliability)}};
}

Json to_json(const EvalRow& row) {
  const ErrorSummary& s = row.summary;
  Json json = {{"protocol", row.setting.protocol},
               {"share", optional_json(row.setting.share)},
               {"points", row.setting.points}};
  if (row.bin)
    json["overlap"] = {static_cast<double>(*row.bin) / bins, static_cast<double>(*row.bin + 1) / bins};
  else
    json["overlap"] = nullptr;
  json["method"] = row.method;
  json["icp_keep"] = row.setting.keep;
  json["pairs"] = s.pairs;
  json["failed"] = s.failed;
  json["dr"] = to_json(s.rotation);
  json["dt"] = to_json(s.translation);
  json["dt_fraction"] = to_json(s.translation_fraction);
  json["success"] = {{"5deg_0.1", s.success_5}, {"15deg_0.3", s.success_15}};
  json["recall"] = {{"5deg", s.recall_5}, {"10deg", s.recall_10}, {"20deg", s.recall_20}};
  json["flips"] = s.flips;
  json["timing_ms"] = {{"pair", row.milliseconds}};
  if (row.confidence.poses > 0) json["confidence"] = to_json(row.confidence);
  return json;
}

std::string area_text(const ConfidenceSummary& c) {
  if (!c.area) return "  –  ";
  char text[16];
  std::snprintf(text, sizeof text, "%5.3f", *c.area);
  return text;
}

void print_confidence(const EvalReport& report, const std::vector<EvalRow>& rows, std::size_t width,
                      std::FILE* out) {
  const auto pooled = pooled_confidence(report);
  if (pooled.empty()) return;
  std::fprintf(out,
               "\nconfidence: area under ROC; said, on average; was right (Δr ≤ 20°, Δt ≤ 0.1 diagonals)\n");
  std::string last;
  for (const EvalRow& row : rows) {
    if (row.bin || row.confidence.poses == 0) continue;
    if (const std::string now = title(row); now != last) {
      std::fprintf(out, "%s\n", now.c_str());
      last = now;
    }
    std::fprintf(out, "  %s  %s  %4.2f  %4.2f\n", padded(row.method, width).c_str(),
                 area_text(row.confidence).c_str(), row.confidence.said, row.confidence.was);
  }
  std::fprintf(out, "all of them; reliability, said: was (poses)\n");
  for (const auto& [name, summary] : pooled) {
    std::fprintf(out, "  %s  %s  %4.2f  %4.2f ", padded(name, width).c_str(), area_text(summary).c_str(),
                 summary.said, summary.was);
    for (const ConfidenceBin& bin : summary.bins)
      std::fprintf(out, " %.2f: %.2f (%zu)", bin.said, bin.was, bin.poses);
    std::fputc('\n', out);
  }
}

std::string quoted(const std::string& field) {
  if (field.find_first_of(",\"\r\n") == std::string::npos) return field;
  std::string text = "\"";
  for (const char c : field) {
    if (c == '"') text += '"';
    text += c;
  }
  return text + '"';
}

}  // namespace

std::vector<EvalRow> rows_of(const EvalReport& report) {
  std::vector<EvalRow> rows;
  for (const EvalSetting& setting : report.settings)
    for (int bin = -1; bin < (setting.by_overlap ? bins : 0); ++bin)
      for (const EvalMethod& method : setting.methods) {
        const std::optional<int> which = bin < 0 ? std::nullopt : std::optional(bin);
        EvalRow row{setting,
                    which,
                    method.name,
                    summarise_bin(method, which),
                    confidence_of(method, which),
                    method.milliseconds / static_cast<double>(std::max<std::size_t>(1, method.pairs.size()))};
        if (row.summary.pairs > 0) rows.push_back(std::move(row));
      }
  return rows;
}

std::vector<std::pair<std::string, ConfidenceSummary>> pooled_confidence(const EvalReport& report) {
  std::vector<std::pair<std::string, std::vector<Judgement>>> pooled;
  for (const EvalSetting& setting : report.settings)
    for (const EvalMethod& method : setting.methods) {
      auto found =
          std::find_if(pooled.begin(), pooled.end(), [&](const auto& p) { return p.first == method.name; });
      if (found == pooled.end()) found = pooled.insert(pooled.end(), {method.name, {}});
      add_judgements(method, {}, found->second);
    }
  std::vector<std::pair<std::string, ConfidenceSummary>> summaries;
  for (const auto& [name, judgements] : pooled)
    if (!judgements.empty()) summaries.emplace_back(name, summarise_confidence(judgements));
  return summaries;
}

std::string title(const EvalSetting& setting) {
  return setting.protocol + (setting.share ? ", s = " + text_of(*setting.share) : "") + ", " +
         std::to_string(setting.points) + " points";
}

std::string title(const EvalRow& row) {
  std::string text = title(row.setting);
  if (row.bin)
    text += ", overlap " + std::to_string(*row.bin * 20) + " … " + std::to_string(*row.bin * 20 + 20) + " %";
  return text + ": " + std::to_string(row.summary.pairs) + (row.summary.pairs == 1 ? " pair" : " pairs");
}

void print(const EvalReport& report, std::FILE* out) {
  const std::vector<EvalRow> rows = rows_of(report);
  std::size_t width = 6;
  for (const EvalRow& row : rows) width = std::max(width, row.method.size());
  std::fprintf(out, "%s\n\n", report.data.c_str());
  std::fprintf(out,
               "%s      Δr in degrees            |     Δt in model units,  /diag. | success, %%  |  Δr up "
               "to, %%      |     %% | ms\n"
               "%s  median           mean     std | median    mean     std  median | 5,.1  15,.3 |    5°   "
               "10°   20° | flips | a pair\n",
               padded("", width + 2).c_str(), padded("method", width + 2).c_str());
  std::string last;
  for (const EvalRow& row : rows) {
    if (const std::string now = title(row); now != last) {
      std::fprintf(out, "%s\n", now.c_str());
      last = now;
    }
    std::fprintf(out, "  %s", padded(row.method, width).c_str());
    print(row, out);
  }
  print_confidence(report, rows, width, out);
}

Json to_json(const EvalReport& report) {
  Json json = report.about;
  Json& rows = json["rows"] = Json::array();
  for (const EvalRow& row : rows_of(report)) rows.push_back(to_json(row));
  for (const auto& [name, summary] : pooled_confidence(report)) json["confidence"][name] = to_json(summary);
  Json& skipped = json["skipped"] = Json::array();
  for (const SkippedShape& one : report.skipped)
    skipped.push_back({{"shape", one.shape}, {"reason", one.reason}});
  return json;
}

std::string to_csv(const EvalReport& report) {
  const bool judged = !pooled_confidence(report).empty();
  std::string csv = "shape,protocol,share,overlap,dr,dt,dt_fraction,method,points,sample,failed";
  if (judged)
    csv +=
        ",confidence,score,fit_overlap,interpenetration,rims,rotation_gap,rotation_spread,translation_spread,"
        "refined_by";
  csv += '\n';
  const auto optional = [](const std::optional<double>& value) { return value ? text_of(*value) : ""; };
  for (const EvalSetting& setting : report.settings)
    for (const EvalMethod& method : setting.methods)
      for (const EvalPair& pair : method.pairs) {
        const PoseErrors& e = pair.errors;
        csv += quoted(pair.shape) + ',' + setting.protocol + ',' +
               (setting.share ? text_of(*setting.share) : "") + ',' + text_of(pair.overlap) + ',' +
               text_of(e.rotation) + ',' + text_of(e.translation) + ',' + text_of(e.translation_fraction) +
               ',' + quoted(method.name) + ',' + std::to_string(setting.points) + ',' +
               std::to_string(pair.sample) + ',' + (e.failed ? "1" : "0");
        if (pair.confidence) {
          const Evidence& why = pair.confidence->evidence;
          for (const double value : {pair.confidence->value, why.score, why.overlap, why.interpenetration})
            csv += ',' + text_of(value);
          for (const auto& value :
               {why.rims, why.rotation_gap, why.rotation_spread, why.translation_spread, why.refined_by})
            csv += ',' + optional(value);
        }
        csv += '\n';
      }
  return csv;
}

}  // namespace bitr::tool
