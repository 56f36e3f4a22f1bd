#include "confidence/calibration.hpp"

namespace bitr::confidence {

Confidence judged(const Evidence& evidence) { return {.value = 0.5, .reasons = {}, .evidence = evidence}; }

}  // namespace bitr::confidence
