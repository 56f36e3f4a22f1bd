// Refinement in a command: its options, and what it says about a result.
#pragma once

#include <bitr/refine.hpp>
#include <cstdio>
#include <optional>
#include <string>

#include "cli.hpp"
#include "output.hpp"

namespace bitr::tool {

struct RefineChoice {
  std::optional<RefineMethod> method;  ///< empty: none
  std::optional<RefineProtocol> protocol;
  std::optional<double> keep, least_overlap;
  std::optional<std::uint64_t> iterations;
};

/// --protocol, --keep, --least-overlap, --iterations; the method is the command's own option.
void add_refine_options(CLI::App& app, RefineChoice& choice, const std::string& default_protocol);
/// With the protocol that the command takes unless it is told. `invalid_argument` names the option.
Result<RefineOptions> refine_options(const RefineChoice& choice, RefineProtocol otherwise);

/// Lines of the report: what was done, what was kept and why.
void print(const Refinement& refinement, const RefineOptions& options, std::FILE* out);
Json to_json(const Refinement& refinement, const RefineOptions& options);

}  // namespace bitr::tool
