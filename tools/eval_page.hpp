// What bitr eval found, as a page to look at.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "eval_report.hpp"

namespace bitr::tool {

/// One pair under one method, drawn.
struct EvalCase {
  std::size_t setting = 0, method = 0, pair = 0;  ///< indices into the report
  bool best = false;                              ///< not one of the worst
  std::vector<std::byte> png = {};                ///< empty where nothing can be drawn
};

/// Those that a page shows: of each method in each setting the worst by Δr, then the best; two of each, or
/// one where that would make a long page.
std::vector<EvalCase> worst_and_best(const EvalReport& report);

/// HTML, which is XML too, that needs nothing else: the table, confidence if there is any, errors over
/// overlap, histograms of the errors, the cases, the settings. Same report, same bytes.
std::string to_html(const EvalReport& report, const std::vector<EvalCase>& cases);

}  // namespace bitr::tool
