#include "svg/svg.hpp"

#include <cmath>
#include <cstdio>
#include <iterator>

namespace bitr::svg {
namespace {

std::string with_tip(const std::string& name, const std::string& attributes, const std::string& tip) {
  return "<" + name + attributes +
         (tip.empty() ? "/>\n" : "><title>" + escaped(tip) + "</title></" + name + ">\n");
}

}  // namespace

const char* color(std::size_t n) {
  static constexpr const char* colors[] = {"#1f6fb4", "#d1495b", "#2e8b57", "#8e5ea2",
                                           "#e08e0b", "#17a2a2", "#7a5230", "#555555"};
  return colors[n % std::size(colors)];
}

std::string number(double value, const char* format) {
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
    else if (c == '"')
      safe += "&quot;";
    else
      safe += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
  }
  return safe;
}

std::string text_at(double x, double y, const std::string& text, const char* anchor, const char* more) {
  return "<text x=\"" + number(x) + "\" y=\"" + number(y) + "\" text-anchor=\"" + anchor + "\"" + more + ">" +
         escaped(text) + "</text>\n";
}

std::string line(double x1, double y1, double x2, double y2, const std::string& color) {
  return "<line x1=\"" + number(x1) + "\" y1=\"" + number(y1) + "\" x2=\"" + number(x2) + "\" y2=\"" +
         number(y2) + "\" stroke=\"" + color + "\"/>\n";
}

std::string circle(double x, double y, double radius, const std::string& color, const std::string& tip) {
  return with_tip("circle",
                  " cx=\"" + number(x) + "\" cy=\"" + number(y) + "\" r=\"" + number(radius) + "\" fill=\"" +
                      color + "\"",
                  tip);
}

std::string polyline(const std::vector<std::pair<double, double>>& points, const std::string& color) {
  std::string places;
  for (const auto& [x, y] : points) places += number(x) + "," + number(y) + " ";
  return "<polyline fill=\"none\" stroke=\"" + color + "\" stroke-width=\"1.5\" points=\"" + places +
         "\"/>\n";
}

std::string rectangle(double x, double y, double width, double height, const std::string& color,
                      const std::string& tip) {
  return with_tip("rect",
                  " x=\"" + number(x) + "\" y=\"" + number(y) + "\" width=\"" + number(width) +
                      "\" height=\"" + number(height) + "\" fill=\"" + color + "\"",
                  tip);
}

Axis Axis::logarithmic(double low, double high, double from, double to) {
  double first = std::log10(low > 0 && low < high ? low : high / 10), last = std::log10(high);
  if (last - first < 0.1) {
    first -= 0.05;
    last += 0.05;
  }
  return {true, first, last, from, to};
}

Axis Axis::linear(double low, double high, double from, double to) { return {false, low, high, from, to}; }

double Axis::at(double value) const {
  return from_ + ((logarithmic_ ? std::log10(value) : value) - low_) / (high_ - low_) * (to_ - from_);
}

std::vector<double> Axis::ticks() const {
  std::vector<double> all;
  if (!logarithmic_) {
    // The largest of 1, 2 and 5 times a power of ten that gives four steps or more.
    const double rough = (high_ - low_) / 4, decade = std::pow(10.0, std::floor(std::log10(rough)));
    const double step = decade * (rough >= 5 * decade ? 5 : rough >= 2 * decade ? 2 : 1);
    for (double i = std::ceil(low_ / step - 1e-9); i * step <= high_ + 1e-9 * step; ++i)
      all.push_back(i * step + 0.0);  // no −0
    return all;
  }
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

std::string grid(const Frame& frame, const Axis& x, const Axis& y) {
  const double right = frame.left + frame.width, bottom = frame.top + frame.height;
  std::string svg;
  for (const double tick : x.ticks())
    svg += line(x.at(tick), frame.top, x.at(tick), bottom, "#ddd") +
           text_at(x.at(tick), bottom + 16, number(tick), "middle");
  for (const double tick : y.ticks())
    svg += line(frame.left, y.at(tick), right, y.at(tick), "#ddd") +
           text_at(frame.left - 6, y.at(tick) + 4, number(tick), "end");
  return svg;
}

std::string head(double width, double height) {
  return "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 " + number(width) + " " + number(height) +
         "\" font-family=\"sans-serif\" font-size=\"12\">\n" +
         "<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n";
}

}  // namespace bitr::svg
