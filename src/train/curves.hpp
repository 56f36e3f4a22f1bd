// The history as a picture that needs nothing else to be looked at.
#pragma once

#include <string>

#include "train/metrics.hpp"

namespace bitr::train {

/// SVG: the loss's terms, and the medians of each validation group's Δr and Δt, over the steps; logarithmic
/// on both axes.
std::string curves_svg(const History& history, const std::string& title);

}  // namespace bitr::train
