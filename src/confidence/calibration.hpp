// From evidence to a probability.
#pragma once

#include <bitr/confidence.hpp>

namespace bitr::confidence {

/// value and reasons of a pose with that evidence.
Confidence confidence_in(const Evidence& evidence);

}  // namespace bitr::confidence
