#include "eval_page.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "core/base64.hpp"
#include "core/median.hpp"
#include "svg/svg.hpp"

namespace bitr::tool {
namespace {

using svg::escaped, svg::number, svg::text_at;

constexpr const char* style = R"(
:root { color-scheme: light dark; }
body { max-width: 1100px; margin: 2rem auto; padding: 0 1rem; font: 15px/1.45 system-ui, sans-serif; }
h2 { margin-top: 2.2rem; border-bottom: 1px solid #8886; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { padding: 0.1rem 0.55rem; text-align: right; }
th:first-child, td:first-child { text-align: left; }
thead th { border-bottom: 1px solid #8886; }
tbody th { padding-top: 0.7rem; text-align: left; }
dl { display: grid; grid-template-columns: auto 1fr; gap: 0.1rem 1rem; }
dt { opacity: 0.7; }
dd { margin: 0; overflow-wrap: anywhere; }
svg, img { display: block; width: 100%; height: auto; border-radius: 6px; background: white; }
figure { margin: 1rem 0; }
.small { max-width: 620px; }
figcaption { margin-bottom: 0.3rem; }
)";

std::string element(const std::string& name, const std::string& content, const std::string& attributes = {}) {
  return "<" + name + attributes + ">" + content + "</" + name + ">";
}

std::string percent(double share) { return number(100 * share, "%.1f"); }

std::string table(const EvalReport& report) {
  std::string head;
  for (const char* title :
       {"method", "Δr median", "±", "mean", "std", "Δt median", "mean", "std", "/ diag. median", "5°, 0.1",
        "15°, 0.3", "≤ 5°", "≤ 10°", "≤ 20°", "flips", "failed"})
    head += element("th", title, " scope=\"col\"");
  std::string body, last;
  for (const EvalRow& row : rows_of(report)) {
    if (const std::string now = title(row); now != last) {
      body += element("tr", element("th", escaped(now), " colspan=\"16\" scope=\"colgroup\"")) + "\n";
      last = now;
    }
    const ErrorSummary& s = row.summary;
    const Distribution &r = s.rotation, &t = s.translation;
    std::string cells = element("td", escaped(row.method));
    for (const double degrees : {r.median, r.median_error, r.mean, r.std})
      cells += element("td", number(degrees, "%.2f"));
    for (const double length : {t.median, t.mean, t.std, s.translation_fraction.median})
      cells += element("td", number(length, "%.4f"));
    for (const double share : {s.success_5, s.success_15, s.recall_5, s.recall_10, s.recall_20, s.flips})
      cells += element("td", percent(share));
    body += element("tr", cells + element("td", std::to_string(s.failed))) + "\n";
  }
  return element("div",
                 element("table", element("thead", element("tr", head)) + "\n" + element("tbody", body)),
                 " class=\"wide\"") +
         element(
             "p",
             "Δr in degrees, Δt in model units and as a share of the object’s diagonal; ± is the median’s "
             "standard error. Success (Δr and Δt over the diagonal), recall and flips (Δr above 135°) in %.");
}

/// Bars of equal width from 0 on; the last one takes what lies beyond.
struct Histogram {
  std::string what, unit;
  double width;  ///< a bar's
  int bars;
};

std::string histogram(const svg::Frame& frame, const Histogram& how, const std::vector<double>& values,
                      const std::string& color) {
  std::vector<int> counts(static_cast<std::size_t>(how.bars));
  for (const double value : values)
    ++counts[static_cast<std::size_t>(std::min(value / how.width, how.bars - 1.0))];
  const int most = std::max(4, *std::max_element(counts.begin(), counts.end()));
  const double right = frame.left + frame.width, bottom = frame.top + frame.height;
  const auto x = svg::Axis::linear(0, how.width * how.bars, frame.left, right),
             y = svg::Axis::linear(0, most, bottom, frame.top);
  std::string chart = svg::grid(frame, x, y);
  for (int bar = 0; bar < how.bars; ++bar) {
    const int count = counts[static_cast<std::size_t>(bar)];
    if (count == 0) continue;
    const double from = bar * how.width, to = from + how.width;
    const std::string last = bar + 1 == how.bars ? " and more" : "";
    chart += svg::rectangle(x.at(from), y.at(count), x.at(to) - x.at(from) - 0.5, bottom - y.at(count), color,
                            number(from) + " … " + number(to) + how.unit + last + ": " +
                                std::to_string(count) + (count == 1 ? " pair" : " pairs"));
  }
  return chart + text_at(right, bottom + 32, how.what, "end");
}

std::string histograms(const EvalSetting& setting) {
  constexpr double row = 150, width = 430, top = 30;
  std::string image = svg::head(1040, row * static_cast<double>(setting.methods.size()) + 10);
  for (std::size_t m = 0; m < setting.methods.size(); ++m) {
    const EvalMethod& method = setting.methods[m];
    std::vector<double> degrees, fractions;
    for (const EvalPair& pair : method.pairs) {
      degrees.push_back(pair.errors.rotation);
      fractions.push_back(pair.errors.translation_fraction);
    }
    const double at = row * static_cast<double>(m) + top;
    image += text_at(50, at - 10, method.name, "start", " font-weight=\"bold\"");
    image += histogram({50, at, width, row - 75}, {"Δr, degrees", "°", 5, 36}, degrees, svg::color(m));
    image += histogram({570, at, width, row - 75}, {"Δt over the diagonal", "", 0.025, 40}, fractions,
                       svg::color(m));
  }
  return image + "</svg>\n";
}

/// Where a pair is across the chart, in %.
using Across = std::function<double(const EvalSetting&, const EvalPair&)>;

constexpr double least_degrees = 0.01;  // what is nearer is drawn there

/// A method's pairs as dots, their medians as a line: one for each setting, or for each tenth of the axis
/// where a setting has many overlaps.
std::string scatter(const std::vector<const EvalSetting*>& settings, std::size_t method, const Across& across,
                    const svg::Axis& x, const svg::Axis& y) {
  constexpr std::size_t most = 1500;
  std::size_t pairs = 0, index = 0;
  for (const EvalSetting* setting : settings) pairs += setting->methods[method].pairs.size();
  const std::size_t step = (pairs + most - 1) / most;
  std::vector<std::pair<double, double>> medians;
  std::string dots;
  const auto height = [&](double degrees) { return y.at(std::max(degrees, least_degrees)); };
  for (const EvalSetting* setting : settings) {
    std::vector<std::vector<double>> places(setting->by_overlap ? 10 : 1), degrees(places.size());
    for (const EvalPair& pair : setting->methods[method].pairs) {
      const double at = across(*setting, pair);
      if (index++ % step == 0)
        dots += svg::circle(x.at(at), height(pair.errors.rotation), 2, svg::color(method));
      const std::size_t bin =
          places.size() == 1 ? 0 : static_cast<std::size_t>(std::clamp(at / 10, 0.0, 9.0));
      places[bin].push_back(at);
      degrees[bin].push_back(pair.errors.rotation);
    }
    for (std::size_t bin = 0; bin < places.size(); ++bin)
      if (!places[bin].empty()) medians.emplace_back(x.at(median(places[bin])), height(median(degrees[bin])));
  }
  std::sort(medians.begin(), medians.end());
  std::string chart =
      element("g", dots, " opacity=\"0.3\"") + "\n" + svg::polyline(medians, svg::color(method));
  for (const auto& [px, py] : medians) chart += svg::circle(px, py, 4, svg::color(method));
  return chart;
}

std::string legend_entry(std::size_t method, const std::string& name, double left, double top) {
  const double at = top + 12 + 20 * static_cast<double>(method);
  return svg::rectangle(left, at - 8, 14, 8, svg::color(method)) + text_at(left + 21, at, name, "start");
}

/// For settings with one number of points; empty where neither overlap nor share differ.
std::string errors_over_overlap(const std::vector<const EvalSetting*>& settings) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  const auto range = [&](const Across& across) {
    double low = infinity, high = -infinity;
    for (const EvalSetting* setting : settings)
      for (const EvalPair& pair : setting->methods[0].pairs) {
        low = std::min(low, across(*setting, pair));
        high = std::max(high, across(*setting, pair));
      }
    return high - low;
  };
  Across across = [](const EvalSetting&, const EvalPair& pair) { return 100 * pair.overlap; };
  std::string what = "overlap of the clouds, %";
  if (!(range(across) > 1e-6)) {
    across = [](const EvalSetting& setting, const EvalPair&) { return 100 * setting.share.value_or(0); };
    what = "share that a crop keeps, %";
    if (!(range(across) > 1e-6)) return {};
  }
  const svg::Frame frame{60, 20, 700, 300};
  const auto x = svg::Axis::linear(0, 100, frame.left, frame.left + frame.width),
             y = svg::Axis::logarithmic(least_degrees, 180, frame.top + frame.height, frame.top);
  std::string image = svg::head(1040, 370) + svg::grid(frame, x, y);
  for (std::size_t m = 0; m < settings[0]->methods.size(); ++m) {
    image += scatter(settings, m, across, x, y);
    image += legend_entry(m, settings[0]->methods[m].name, 785, frame.top);
  }
  return image + text_at(60, 354, "Δr in degrees: a dot is a pair, a line joins medians", "start") +
         text_at(760, 354, what, "end") + "</svg>\n";
}

std::string errors_over_overlap(const EvalReport& report) {
  std::string charts;
  std::vector<std::uint64_t> seen;
  for (const EvalSetting& setting : report.settings) {
    if (std::find(seen.begin(), seen.end(), setting.points) != seen.end()) continue;
    seen.push_back(setting.points);
    std::vector<const EvalSetting*> settings;
    for (const EvalSetting& other : report.settings)
      if (other.points == setting.points) settings.push_back(&other);
    const std::string chart = errors_over_overlap(settings);
    if (!chart.empty())
      charts +=
          element("figure", element("figcaption", std::to_string(setting.points) + " points") + chart) + "\n";
  }
  return charts.empty() ? charts : element("h2", "Errors over overlap") + "\n" + charts;
}

using MethodConfidence = std::vector<std::pair<std::string, ConfidenceSummary>>;

std::string reliability(const MethodConfidence& methods) {
  const svg::Frame frame{60, 20, 320, 320};
  const auto x = svg::Axis::linear(0, 1, frame.left, frame.left + frame.width),
             y = svg::Axis::linear(0, 1, frame.top + frame.height, frame.top);
  std::string image =
      svg::head(620, 385) + svg::grid(frame, x, y) + svg::line(x.at(0), y.at(0), x.at(1), y.at(1), "#999999");
  for (std::size_t m = 0; m < methods.size(); ++m) {
    const auto& [name, summary] = methods[m];
    std::vector<std::pair<double, double>> places;
    std::string dots;
    for (const ConfidenceBin& bin : summary.bins) {
      places.emplace_back(x.at(bin.said), y.at(bin.was));
      const double share = static_cast<double>(bin.poses) / static_cast<double>(summary.poses);
      dots += svg::circle(x.at(bin.said), y.at(bin.was), 3 + 7 * std::sqrt(share), svg::color(m),
                          name + ": said " + number(bin.said, "%.2f") + ", was " + number(bin.was, "%.2f") +
                              " (" + std::to_string(bin.poses) + (bin.poses == 1 ? " pose)" : " poses)"));
    }
    image += svg::polyline(places, svg::color(m)) + element("g", dots, " opacity=\"0.7\"") + "\n" +
             legend_entry(m, name, 405, frame.top);
  }
  return image + text_at(60, 374, "share of the poses that were right", "start") +
         text_at(380, 374, "mean confidence", "end") + "</svg>\n";
}

std::string confidence_row(const std::string& method, const ConfidenceSummary& summary) {
  std::string cells = element("td", escaped(method)) + element("td", std::to_string(summary.poses)) +
                      element("td", summary.area ? number(*summary.area, "%.3f") : "–");
  for (const double share : {summary.said, summary.was}) cells += element("td", number(share, "%.2f"));
  return element("tr", cells) + "\n";
}

/// Empty where no pose was judged.
std::string confidence(const EvalReport& report) {
  const MethodConfidence methods = pooled_confidence(report);
  if (methods.empty()) return {};
  std::string head, body, last;
  const auto add = [&](const std::string& title, const std::string& method,
                       const ConfidenceSummary& summary) {
    if (title != last)
      body += element("tr", element("th", escaped(title), " colspan=\"5\" scope=\"colgroup\"")) + "\n";
    last = title;
    body += confidence_row(method, summary);
  };
  for (const char* title : {"method", "poses", "area under ROC", "said, on average", "was right"})
    head += element("th", title, " scope=\"col\"");
  for (const EvalRow& row : rows_of(report))
    if (!row.bin && row.confidence.poses > 0) add(title(row.setting), row.method, row.confidence);
  if (report.settings.size() > 1)
    for (const auto& [method, summary] : methods) add("all of them", method, summary);
  return element("h2", "Confidence") + "\n" +
         element("div",
                 element("table", element("thead", element("tr", head)) + "\n" + element("tbody", body)),
                 " class=\"wide\" id=\"confidence\"") +
         element("p",
                 "Right is a pose with Δr up to 20° and Δt up to 0.1 of the diagonal. The area under the ROC "
                 "curve is the chance that a right pose has more confidence than a wrong one.") +
         "\n" +
         element("figure",
                 element("figcaption",
                         "Reliability: a dot is a tenth of the scale, the larger the more poses; on the "
                         "grey line poses are right as often as their confidence says") +
                     reliability(methods),
                 " class=\"small\"") +
         "\n";
}

std::string figure(const EvalReport& report, const EvalCase& one) {
  const EvalMethod& method = report.settings[one.setting].methods[one.method];
  const EvalPair& pair = method.pairs[one.pair];
  const PoseErrors& e = pair.errors;
  const std::string caption =
      (one.best ? "Best of " : "Worst of ") + escaped(method.name + ": " + pair.shape) + ", pair " +
      std::to_string(pair.sample) + ": overlap " + number(100 * pair.overlap, "%.0f") + " %, " +
      (e.failed ? "the pose is not finite"
                : "Δr " + number(e.rotation, "%.2f") + "°, Δt " + number(e.translation_fraction, "%.3f") +
                      " of the diagonal") +
      (pair.confidence ? ", confidence " + number(pair.confidence->value, "%.2f") : "");
  std::string image;
  if (!one.png.empty())
    image = "<img alt=\"Source, reference, both as given, both as estimated\" src=\"data:image/png;base64," +
            base64(one.png) + "\"/>";
  return element("figure", element("figcaption", caption) + image) + "\n";
}

std::string text_of(const Json& value) {
  if (value.is_string()) return value.get<std::string>();
  if (value.is_boolean()) return value.get<bool>() ? "yes" : "no";
  return value.dump();
}

std::string list(const Json& json) {
  std::string items;
  for (const auto& [key, value] : json.items()) {
    if (value.is_structured()) continue;
    std::string name = key;
    std::replace(name.begin(), name.end(), '_', ' ');
    items += element("dt", escaped(name)) + element("dd", escaped(text_of(value))) + "\n";
  }
  return element("dl", items);
}

std::string settings_of(const EvalReport& report) {
  std::string html = element("h2", "What was evaluated") + "\n" + list(report.about);
  for (const Json& model : report.about.value("models", Json::array()))
    html += element("h3", "Model " + escaped(text_of(model["method"]))) + list(model);
  for (const SkippedShape& one : report.skipped)
    html += element("p", escaped("Skipped: " + one.shape + ": " + one.reason));
  return html;
}

}  // namespace

std::vector<EvalCase> worst_and_best(const EvalReport& report) {
  constexpr std::size_t long_page = 32;
  std::size_t methods = 0;
  for (const EvalSetting& setting : report.settings) methods += setting.methods.size();
  const std::size_t each = 4 * methods <= long_page ? 2 : 1;
  std::vector<EvalCase> cases;
  for (std::size_t s = 0; s < report.settings.size(); ++s)
    for (std::size_t m = 0; m < report.settings[s].methods.size(); ++m) {
      const std::vector<EvalPair>& pairs = report.settings[s].methods[m].pairs;
      std::vector<std::size_t> order(pairs.size());
      for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
      std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
        const PoseErrors &x = pairs[a].errors, &y = pairs[b].errors;
        return std::pair(x.rotation, x.translation) > std::pair(y.rotation, y.translation);
      });
      const std::size_t worst = std::min(each, order.size()), best = std::min(each, order.size() - worst);
      for (std::size_t i = 0; i < worst; ++i) cases.push_back({s, m, order[i]});
      for (std::size_t i = 0; i < best; ++i) cases.push_back({s, m, order[order.size() - 1 - i], true});
    }
  return cases;
}

std::string to_html(const EvalReport& report, const std::vector<EvalCase>& cases) {
  std::string html =
      "<!DOCTYPE html>\n<html xmlns=\"http://www.w3.org/1999/xhtml\" lang=\"en\">\n<head>\n"
      "<meta charset=\"utf-8\"/>\n<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n"
      "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'; "
      "img-src data:\"/>\n<link rel=\"icon\" href=\"data:,\"/>\n" +
      element("title", "bitr eval: " + escaped(report.data)) + "\n" + element("style", style) +
      "\n</head>\n<body>\n" + element("h1", "bitr eval") + "\n" + element("p", escaped(report.data)) + "\n" +
      table(report) + "\n" + confidence(report) + errors_over_overlap(report);
  for (std::size_t s = 0; s < report.settings.size(); ++s) {
    const EvalSetting& setting = report.settings[s];
    html += element("h2", escaped(title(setting))) + "\n" +
            element("figure",
                    element("figcaption", "Pairs by their errors; what is beyond counts in the last bar") +
                        histograms(setting)) +
            "\n" + element("h3", "Each method’s worst and best pairs") + "\n";
    for (const EvalCase& one : cases)
      if (one.setting == s) html += figure(report, one);
  }
  return html + settings_of(report) + "\n</body>\n</html>\n";
}

}  // namespace bitr::tool
