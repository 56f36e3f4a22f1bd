// Pieces of a chart as text of SVG, of which HTML is made too.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace bitr::svg {

/// The look of the n-th line of a chart; distinct for eight.
const char* color(std::size_t n);

std::string number(double value, const char* format = "%.4g");

/// As text, or within a quoted attribute.
std::string escaped(const std::string& text);

/// `anchor`: start, middle or end. `more`: further attributes, with a blank in front.
std::string text_at(double x, double y, const std::string& text, const char* anchor, const char* more = "");

std::string line(double x1, double y1, double x2, double y2, const std::string& color);
/// `tip`: what a pointer that rests there is told; may be empty.
std::string circle(double x, double y, double radius, const std::string& color, const std::string& tip = {});
/// "x,y x,y " of all points.
std::string polyline(const std::vector<std::pair<double, double>>& points, const std::string& color);
std::string rectangle(double x, double y, double width, double height, const std::string& color,
                      const std::string& tip = {});

/// From numbers to places on the page.
class Axis {
 public:
  /// Over whole 1-2-5 steps. `high` is above 0; a `low` that is not, or not below it, is a tenth of it.
  static Axis logarithmic(double low, double high, double from, double to);
  /// `low` is below `high`.
  static Axis linear(double low, double high, double from, double to);

  double at(double value) const;
  std::vector<double> ticks() const;

 private:
  Axis(bool logarithmic, double low, double high, double from, double to)
      : logarithmic_(logarithmic), low_(low), high_(high), from_(from), to_(to) {}

  bool logarithmic_;
  double low_, high_;  ///< logarithms where the axis is logarithmic
  double from_, to_;
};

/// Where a chart's axes are, in the page's units.
struct Frame {
  double left = 0, top = 0, width = 0, height = 0;
};

/// Lines at the axes' ticks, and their numbers to the left and below.
std::string grid(const Frame& frame, const Axis& x, const Axis& y);

/// An image of that size, without its end: white, with text of 12 units.
std::string head(double width, double height);

}  // namespace bitr::svg
