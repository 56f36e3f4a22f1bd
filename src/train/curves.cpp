#include "train/curves.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "svg/svg.hpp"

namespace bitr::train {
namespace {

using svg::Axis, svg::number, svg::text_at;

struct Line {
  std::string name;
  std::vector<std::pair<double, double>> points;  ///< step, value; both above 0
};

constexpr std::size_t few = 60;  // so many points of a line are shown one by one
constexpr double left = 70, width = 640, height = 220, gap = 70, legend = 300;

/// Averages over stretches of the axis, so that a long run's picture stays small.
std::vector<std::pair<double, double>> thinned(const std::vector<std::pair<double, double>>& points) {
  constexpr std::size_t most = 400;
  if (points.size() <= most) return points;
  const double first = std::log(points.front().first), last = std::log(points.back().first);
  std::vector<std::pair<double, double>> means;
  std::vector<std::size_t> counts;
  std::size_t bin_before = most;
  for (const auto& [x, y] : points) {
    const auto bin = static_cast<std::size_t>((std::log(x) - first) / (last - first) * (most - 1));
    if (bin != bin_before) {
      means.emplace_back(0, 0);
      counts.push_back(0);
    }
    bin_before = bin;
    const double n = static_cast<double>(++counts.back());
    means.back().first += (x - means.back().first) / n;
    means.back().second += (y - means.back().second) / n;
  }
  return means;
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
  std::string chart = text_at(left, top - 12, title, "start", " font-weight=\"bold\"");
  if (high == 0) return chart + text_at(left + width / 2, top + height / 2, "nothing yet", "middle");
  const Axis x = Axis::logarithmic(first_step, last_step, left, left + width),
             y = Axis::logarithmic(low, high, top + height, top);
  chart += svg::grid({left, top, width, height}, x, y);
  chart += text_at(left + width / 2, top + height + 32, "step", "middle");
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const std::string color = svg::color(i);
    auto points = thinned(lines[i].points);
    for (auto& [px, py] : points) {
      px = x.at(px);
      py = y.at(py);
    }
    chart += svg::polyline(points, color);
    if (points.size() <= few)
      for (const auto& [px, py] : points) chart += svg::circle(px, py, 2.5, color);
    const double row = top + 14 + 18 * static_cast<double>(i);
    chart += svg::rectangle(left + width + 14, row - 8, 14, 4, color) +
             text_at(left + width + 34, row, lines[i].name, "start");
    if (!lines[i].points.empty())
      chart += text_at(left + width + 14 + legend, row, number(lines[i].points.back().second, "%.3g"), "end");
  }
  return chart;
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
  std::string image =
      svg::head(whole_width, whole_height) + text_at(left, 24, title, "start", " font-size=\"16\"");
  image += panel(64, "Training loss", {rotation, translation}, first, last);
  image += panel(64 + height + gap, "Validation: median rotation error, degrees", degrees, first, last);
  image += panel(64 + 2 * (height + gap), "Validation: median translation error, model units", lengths, first,
                 last);
  return image + "</svg>\n";
}

}  // namespace bitr::train
