#include "train/curves.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <limits>

namespace bitr::train {
namespace {

struct Line {
  std::string name;
  std::vector<std::pair<double, double>> points;  ///< step, value; both above 0
};

constexpr std::size_t few = 60;  // so many points of a line are shown one by one
constexpr const char* colours[] = {"#1f6fb4", "#d1495b", "#2e8b57", "#8e5ea2",
                                   "#e08e0b", "#17a2a2", "#7a5230", "#555555"};
constexpr double left = 70, width = 640, height = 220, gap = 70, legend = 300;

std::string number(double value, const char* format = "%.4g") {
  char text[32];
  std::snprintf(text, sizeof text, format, value);
  return text;
}

std::string escaped(const std::string& text) {
  std::string safe;
  for (const char c : text) {
    if (c == '<')
      safe += "&lt;";
    else if (c == '&')
      safe += "&amp;";
    else
      safe += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
  }
  return safe;
}

std::string text_at(double x, double y, const std::string& text, const char* anchor, const char* more = "") {
  return "<text x=\"" + number(x) + "\" y=\"" + number(y) + "\" text-anchor=\"" + anchor + "\"" + more + ">" +
         escaped(text) + "</text>\n";
}

/// Logarithmic, over whole 1-2-5 steps.
class Axis {
 public:
  Axis(double low, double high, double from, double to) : from_(from), to_(to) {
    low_ = std::log10(low > 0 && low < high ? low : high / 10);
    high_ = std::log10(high);
    if (high_ - low_ < 0.1) {
      low_ -= 0.05;
      high_ += 0.05;
    }
  }

  double at(double value) const {
    return from_ + (std::log10(value) - low_) / (high_ - low_) * (to_ - from_);
  }

  std::vector<double> ticks() const {
    std::vector<double> all;
    const double decades = high_ - low_;
    for (int decade = static_cast<int>(std::floor(low_)); decade <= static_cast<int>(std::ceil(high_));
         ++decade)
      for (const double digit : {1.0, 2.0, 5.0}) {
        const double value = digit * std::pow(10.0, decade), log = std::log10(value);
        if ((digit != 1 && decades > 3.5) || log < low_ - 1e-9 || log > high_ + 1e-9) continue;
        all.push_back(value);
      }
    return all;
  }

 private:
  double from_, to_, low_ = 0, high_ = 0;
};

/// Averages over stretches of the axis, so that a long run's picture stays small.
std::vector<std::pair<double, double>> thinned(const std::vector<std::pair<double, double>>& points) {
  constexpr std::size_t most = 400;
  if (points.size() <= most) return points;
  const double first = std::log(points.front().first), last = std::log(points.back().first);
  std::vector<std::pair<double, double>> kept;
  std::vector<std::size_t> counts;
  std::size_t bin_before = most;
  for (const auto& [x, y] : points) {
    const auto bin = static_cast<std::size_t>((std::log(x) - first) / (last - first) * (most - 1));
    if (bin != bin_before) {
      kept.emplace_back(0, 0);
      counts.push_back(0);
    }
    bin_before = bin;
    const double n = static_cast<double>(++counts.back());
    kept.back().first += (x - kept.back().first) / n;
    kept.back().second += (y - kept.back().second) / n;
  }
  return kept;
}

std::string panel(double top, const std::string& title, const std::vector<Line>& lines, double first_step,
                  double last_step) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  double low = infinity, high = 0;
  for (const Line& line : lines)
    for (const auto& [step, value] : line.points) {
      low = std::min(low, value);
      high = std::max(high, value);
    }
  std::string svg = text_at(left, top - 12, title, "start", " font-weight=\"bold\"");
  if (high == 0) return svg + text_at(left + width / 2, top + height / 2, "nothing yet", "middle");
  const Axis x(first_step, last_step, left, left + width), y(low, high, top + height, top);
  const auto grid = [](double x1, double y1, double x2, double y2) {
    return "<line x1=\"" + number(x1) + "\" y1=\"" + number(y1) + "\" x2=\"" + number(x2) + "\" y2=\"" +
           number(y2) + "\" stroke=\"#ddd\"/>\n";
  };
  for (const double tick : x.ticks())
    svg += grid(x.at(tick), top, x.at(tick), top + height) +
           text_at(x.at(tick), top + height + 16, number(tick), "middle");
  for (const double tick : y.ticks())
    svg += grid(left, y.at(tick), left + width, y.at(tick)) +
           text_at(left - 6, y.at(tick) + 4, number(tick), "end");
  svg += text_at(left + width / 2, top + height + 32, "step", "middle");
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const std::string colour = colours[i % std::size(colours)];
    std::string places, dots;
    const auto points = thinned(lines[i].points);
    for (const auto& [step, value] : points) {
      const std::string px = number(x.at(step)), py = number(y.at(value));
      places += px + "," + py + " ";
      if (points.size() <= few)
        dots += "<circle cx=\"" + px + "\" cy=\"" + py + "\" r=\"2.5\" fill=\"" + colour + "\"/>\n";
    }
    svg += "<polyline fill=\"none\" stroke=\"" + colour + "\" stroke-width=\"1.5\" points=\"" + places +
           "\"/>\n" + dots;
    const double row = top + 14 + 18 * static_cast<double>(i);
    svg += "<rect x=\"" + number(left + width + 14) + "\" y=\"" + number(row - 8) +
           "\" width=\"14\" height=\"4\" fill=\"" + colour + "\"/>\n" +
           text_at(left + width + 34, row, lines[i].name, "start");
    if (!lines[i].points.empty())
      svg += text_at(left + width + 14 + legend, row, number(lines[i].points.back().second, "%.3g"), "end");
  }
  return svg;
}

}  // namespace

std::string curves_svg(const History& history, const std::string& title) {
  Line rotation{"rotation", {}}, translation{"translation", {}};
  double first = std::numeric_limits<double>::infinity(), last = 1;
  const auto add = [&](Line& line, std::size_t step, double value) {
    if (step == 0 || !(value > 0) || !std::isfinite(value)) return;
    const auto x = static_cast<double>(step);
    first = std::min(first, x);
    last = std::max(last, x);
    line.points.emplace_back(x, value);
  };
  for (const Measured& loss : history.losses) {
    add(rotation, loss.step, loss.rotation);
    add(translation, loss.step, loss.translation);
  }
  std::vector<Line> degrees, lengths;
  for (const ValidationResult& validation : history.validations)
    for (const ValidationGroup& group : validation.groups) {
      const auto same = [&](const Line& line) { return line.name == group.name; };
      auto at = std::find_if(degrees.begin(), degrees.end(), same) - degrees.begin();
      if (at == static_cast<std::ptrdiff_t>(degrees.size())) {
        degrees.push_back({group.name, {}});
        lengths.push_back({group.name, {}});
      }
      add(degrees[static_cast<std::size_t>(at)], validation.step, group.errors.rotation.median);
      add(lengths[static_cast<std::size_t>(at)], validation.step, group.errors.translation.median);
    }
  if (!(first <= last)) first = 1;
  const double whole_width = left + width + 14 + legend + 30, whole_height = 3 * (height + gap) + 60;
  std::string svg = "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 " + number(whole_width) + " " +
                    number(whole_height) + "\" font-family=\"sans-serif\" font-size=\"12\">\n" +
                    "<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n" +
                    text_at(left, 24, title, "start", " font-size=\"16\"");
  svg += panel(64, "Training loss", {rotation, translation}, first, last);
  svg += panel(64 + height + gap, "Validation: median rotation error, degrees", degrees, first, last);
  svg += panel(64 + 2 * (height + gap), "Validation: median translation error, model units", lengths, first,
               last);
  return svg + "</svg>\n";
}

}  // namespace bitr::train
