#include <algorithm>
#include <bitr/evaluate.hpp>

namespace bitr {
namespace {

constexpr int most_bins = 10;

std::optional<double> area_under_roc(std::vector<Judgement> judgements) {
  std::sort(judgements.begin(), judgements.end(),
            [](const Judgement& a, const Judgement& b) { return a.confidence < b.confidence; });
  double won = 0, right = 0, wrong = 0;
  for (std::size_t begin = 0, end; begin < judgements.size(); begin = end) {
    double tied_right = 0, tied_wrong = 0;
    for (end = begin; end < judgements.size() && judgements[end].confidence == judgements[begin].confidence;
         ++end)
      ++(judgements[end].right ? tied_right : tied_wrong);
    won += tied_right * (wrong + tied_wrong / 2);
    right += tied_right;
    wrong += tied_wrong;
  }
  if (right == 0 || wrong == 0) return {};
  return won / (right * wrong);
}

}  // namespace

bool near_truth(const PoseErrors& errors) {
  return errors.rotation <= 20 && errors.translation_fraction <= 0.1;
}

ConfidenceSummary summarise_confidence(std::span<const Judgement> judgements) {
  ConfidenceSummary summary;
  std::vector<ConfidenceBin> bins(most_bins);
  for (const Judgement& judgement : judgements) {
    const int at = std::clamp(static_cast<int>(judgement.confidence * most_bins), 0, most_bins - 1);
    ConfidenceBin& bin = bins[static_cast<std::size_t>(at)];
    bin.low = static_cast<double>(at) / most_bins;
    bin.high = static_cast<double>(at + 1) / most_bins;
    ++bin.poses;
    bin.said += judgement.confidence;
    bin.was += judgement.right;
  }
  for (ConfidenceBin& bin : bins) {
    if (bin.poses == 0) continue;
    summary.poses += bin.poses;
    summary.said += bin.said;
    summary.was += bin.was;
    bin.said /= static_cast<double>(bin.poses);
    bin.was /= static_cast<double>(bin.poses);
    summary.bins.push_back(bin);
  }
  if (summary.poses > 0) {
    summary.said /= static_cast<double>(summary.poses);
    summary.was /= static_cast<double>(summary.poses);
  }
  summary.area = area_under_roc({judgements.begin(), judgements.end()});
  return summary;
}

}  // namespace bitr
