#include "refinement.hpp"

#include <CLI/CLI.hpp>

#include "options.hpp"

namespace bitr::tool {

void add_refine_options(CLI::App& app, RefineChoice& choice, const std::string& default_protocol) {
  add_choice<RefineProtocol>(
      app, "--protocol", {{"default", RefineProtocol::adaptive}, {"official", RefineProtocol::official}},
      choice.protocol,
      "Refine with lengths in the clouds' spacing and an estimated overlap (default), or with the official "
      "code's constants and stopping rules")
      ->default_str(default_protocol);
  app.add_option("--keep", choice.keep,
                 "Share of the smaller cloud's points that ICP keeps; estimated unless given, 0.8 with the "
                 "official protocol")
      ->type_name("SHARE");
  app.add_option("--least-overlap", choice.least_overlap,
                 "Do not refine where fewer points have a counterpart at the start; 0: always")
      ->type_name("SHARE")
      ->default_str("0.2");
  add_count(app, "--iterations", choice.iterations, 1, 100'000,
            "Stop refining after so many; the protocol's number unless given");
}

Result<RefineOptions> refine_options(const RefineChoice& choice, RefineProtocol otherwise) {
  RefineOptions options;
  options.method = choice.method.value_or(RefineMethod::icp);
  options.protocol = choice.protocol.value_or(otherwise);
  options.keep = choice.keep;
  const auto wrong = [](const std::string& option, double value, const std::string& why) {
    return fail(ErrorCode::invalid_argument, option + " " + Json(value).dump() + ": " + why);
  };
  if (choice.keep && !(*choice.keep > 0 && *choice.keep <= 1))
    return wrong("--keep", *choice.keep, "is not above 0 and up to 1");
  if (choice.keep && options.method != RefineMethod::icp)
    return wrong("--keep", *choice.keep, "is of ICP; optimal transport has a slack");
  if (choice.least_overlap) {
    if (!(*choice.least_overlap >= 0 && *choice.least_overlap <= 1))
      return wrong("--least-overlap", *choice.least_overlap, "is not in 0 … 1");
    if (options.protocol == RefineProtocol::official)
      return wrong("--least-overlap", *choice.least_overlap, "the official protocol always refines");
    options.least_overlap = *choice.least_overlap;
  }
  if (choice.iterations) options.most_iterations = static_cast<int>(*choice.iterations);
  return options;
}

void print(const Refinement& r, const RefineOptions& options, std::FILE* out) {
  std::fprintf(out, "refinement  %s, %s protocol: %d iteration%s%s\n", name(options.method).data(),
               name(options.protocol).data(), r.iterations, r.iterations == 1 ? "" : "s",
               r.iterations == 0 ? "" : (r.converged ? ", converged" : ", not converged"));
  std::fprintf(out, "kept        %s%s%s\n", r.improved ? "the refined pose" : "the start",
               r.improved ? "" : ": ", r.reason.c_str());
  std::fprintf(out, "score       %.4f before, %.4f after, in 0 … 1\n", r.score_before, r.score_after);
  std::fprintf(out, "fit         %.1f %% of the source has a counterpart", 100 * r.overlap);
  if (r.rmse) std::fprintf(out, ", RMSE %.4g", *r.rmse);
  std::fprintf(out, "; spacing %.4g\n", r.spacing);
}

Json to_json(const Refinement& r, const RefineOptions& options) {
  return {{"method", name(options.method)},
          {"protocol", name(options.protocol)},
          {"iterations", r.iterations},
          {"converged", r.converged},
          {"kept", r.improved ? "after" : "before"},
          {"reason", r.reason},
          {"score_before", r.score_before},
          {"score_after", r.score_after},
          {"overlap_before", r.overlap_before},
          {"overlap", r.overlap},
          {"rmse", optional_json(r.rmse)},
          {"spacing", r.spacing},
          {"before", matrix_json(r.start)},
          {"after", matrix_json(r.proposal)}};
}

}  // namespace bitr::tool
