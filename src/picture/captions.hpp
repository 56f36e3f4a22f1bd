// What is drawn over the clouds: letters, the marks of key points, a measure of length.
#pragma once

#include <bitr/picture.hpp>
#include <string>
#include <string_view>

#include "picture/canvas.hpp"

namespace bitr::picture {

/// Dots across, at one pixel a dot.
int text_width(std::string_view text);
inline constexpr int text_height = 9;

/// Small letters, digits and ",.%-" in a built-in pixel font; anything else is a blank. What falls outside
/// the image is left out.
void draw_text(Image& image, std::string_view text, int left, int top, int letter, const Color& color);

/// 1234567 as "1,234,567".
std::string with_commas(std::size_t number);

/// A disc with a rim, smooth at its edges.
void draw_mark(Image& image, float x, float y, float radius, float rim, const Color& fill, const Color& edge);

void fill(Image& image, int left, int top, int width, int height, const Color& color);

}  // namespace bitr::picture
