// From evidence to numbers that can be acted on.
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "solve/propose.hpp"

namespace bitr::solving {

/// The probability that each pose is the true one, the poses being distinct and the best first. The best has what
/// its margin to the next, its score less what conflict takes, the number of points that touch and its slack leave
/// it, as a product; of the rest the others have their share by their scores, of which again only what their own
/// scores leave them. `slacks` are of the first few.
std::vector<double> beliefs(const std::vector<Candidate>& poses, const std::vector<double>& slacks);

/// The probabilities of answers that were each judged alone, given that of those which contradict each other one is right
/// at most: each by its odds. An answer that none contradicts keeps its own.
std::vector<double> shared_by_odds(const std::vector<double>& confidences,
                                   const std::function<bool(std::size_t, std::size_t)>& contradict);

/// How far the next distinct pose's score is below the best one's, as a share of it.
double margin(const std::vector<Candidate>& poses);

/// Of a fit: points hovering over the other's surface, as a share of those and the ones with a counterpart.
double conflict_share(const Fit& fit);

}  // namespace bitr::solving
