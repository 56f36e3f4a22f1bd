#include "solve/pipeline.hpp"

#include <algorithm>
#include <iterator>

#include "solve/belief.hpp"

namespace bitr::solving {
namespace {

constexpr std::size_t level_points[] = {3000, 5000};
// A finer level than this part of the one before shows nothing new.
constexpr double least_gain = 0.85;
constexpr std::size_t most_settled = 24, most_kept = 12, turned_over_from = 3, most_slacks = 3;
constexpr std::size_t prescored_every = 3;
// Beyond this more proposals are not worth their time.
constexpr double beyond_doubt = 0.9;
// With this a finer level is not worth its time either.
constexpr double likely = 0.7;

// Of the points of a closed surface hardly any is on a rim.
constexpr double most_rim = 0.02;
// What two views of one closed surface share, at least.
constexpr double least_copy = 0.8;

bool closed(const Level& level) {
  const auto rim = static_cast<double>(std::count(level.rim.begin(), level.rim.end(), 1));
  return rim <= most_rim * static_cast<double>(level.size());
}

void make_solid(Level& level, const Neighbours& near) {
  level.solid = true;
  level.normals = signed_normals(level, near, level.given_normals ? Signs::given : Signs::spread);
}

class Search {
 public:
  Search(std::unique_ptr<LevelPair> level, ThreadPool& pool)
      : level_(std::move(level)), pool_(pool), motion_(level_->source), proposer_(*level_, pool) {}

  Proposer& proposer() { return proposer_; }
  const LevelPair& level() const { return *level_; }

  /// Settles what is new among the candidates.
  void take(std::vector<Candidate> candidates) {
    const double least = distinct * level_->source.resolution;
    std::stable_sort(candidates.begin(), candidates.end(),
                     [](const Candidate& a, const Candidate& b) { return a.support > b.support; });
    std::vector<Candidate> fresh;
    for (Candidate& c : candidates)
      if (!known(c, fresh, least) && !known(c, tried_, least / 2)) fresh.push_back(std::move(c));
    each(fresh, [&](Candidate& c) { c.fit = fit(level_->source, level_->reference, c.T, prescored_every); });
    sort(fresh);
    if (fresh.size() > most_settled) fresh.resize(most_settled);
    tried_.insert(tried_.end(), fresh.begin(), fresh.end());
    each(fresh, [&](Candidate& c) {
      // What only touches draws from no distance.
      const double reach = level_->source.solid ? 0.5 : 1;
      c.T = icp(level_->source, level_->reference, c.T,
                {.catches = 3 * reach, .ends = 1.5 * reach, .iterations = 15});
      c.fit = fit(level_->source, level_->reference, c.T);
    });
    poses_.insert(poses_.end(), fresh.begin(), fresh.end());
    keep_distinct();
  }

  /// The few best, on every point and to the end.
  void finish() {
    each_of_first(most_slacks, [&](Candidate& c) {
      c.T = icp(level_->source, level_->reference, c.T,
                {.catches = 1.5, .ends = 1, .iterations = 60, .points = static_cast<std::size_t>(-1)});
      c.fit = fit(level_->source, level_->reference, c.T);
    });
    keep_distinct();
    judge(most_slacks);
  }

  /// Takes up poses that are settled already.
  void keep(std::vector<Candidate> settled) {
    tried_.insert(tried_.end(), settled.begin(), settled.end());
    poses_.insert(poses_.end(), std::make_move_iterator(settled.begin()),
                  std::make_move_iterator(settled.end()));
    keep_distinct();
  }
  void judge_all() { judge(most_slacks); }

  bool believes(double least) {
    judge(1);
    return !confidences_.empty() && confidences_[0] >= least;
  }
  const std::vector<Candidate>& poses() const { return poses_; }
  Settled result() && {
    return {std::move(level_), std::move(poses_), std::move(confidences_), std::move(slacks_)};
  }

 private:
  bool known(const Candidate& c, const std::vector<Candidate>& among, double least) const {
    return std::any_of(among.begin(), among.end(),
                       [&](const Candidate& other) { return motion_.between(c.T, other.T) <= least; });
  }
  static void sort(std::vector<Candidate>& candidates) {
    std::stable_sort(candidates.begin(), candidates.end(),
                     [](const Candidate& a, const Candidate& b) { return a.fit.score > b.fit.score; });
  }
  template <class Work>
  void each(std::vector<Candidate>& candidates, const Work& work) {
    pool_.parallel_for(candidates.size(), 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) work(candidates[i]);
    });
  }
  template <class Work>
  void each_of_first(std::size_t count, const Work& work) {
    pool_.parallel_for(std::min(count, poses_.size()), 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) work(poses_[i]);
    });
  }
  void keep_distinct() {
    std::vector<Candidate> all = std::move(poses_);
    sort(all);
    poses_.clear();
    for (Candidate& c : all)
      if (poses_.size() < most_kept && !known(c, poses_, distinct * level_->source.resolution))
        poses_.push_back(std::move(c));
  }
  void judge(std::size_t most) {
    slacks_.assign(std::min(most, poses_.size()), 1);
    pool_.parallel_for(slacks_.size(), 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i)
        slacks_[i] = slack(level_->source, level_->reference, poses_[i].T, poses_[i].fit.score);
    });
    confidences_ = beliefs(poses_, slacks_);
  }

  std::unique_ptr<LevelPair> level_;
  ThreadPool& pool_;
  Motion motion_;
  Proposer proposer_;
  std::vector<Candidate> tried_, poses_;
  std::vector<double> confidences_, slacks_;
};

std::vector<SignRule> rules_for(const LevelPair& level) {
  std::vector<SignRule> rules;
  if (level.source.given_normals && level.reference.given_normals)
    rules = {{Signs::given, false}, {Signs::given, true}};
  for (const bool facing : {false, true})
    for (const Signs signs : {Signs::outward, Signs::spread}) rules.push_back({signs, facing});
  return rules;
}

// Two closed surfaces are one object seen twice, whole, or two bodies, which touch and do no more.
bool pieces_of_solids(const Search& search) {
  if (!closed(search.level().source) || !closed(search.level().reference)) return false;
  if (search.poses().empty()) return true;
  const Fit& fit = search.poses()[0].fit;
  return std::min(fit.source.near, fit.reference.near) < least_copy;
}

// Poses in which the two are solids; null where none touches.
std::unique_ptr<Search> touch(std::unique_ptr<LevelPair> level, ThreadPool& pool) {
  make_solid(level->source, level->near_source);
  make_solid(level->reference, level->near_reference);
  auto search = std::make_unique<Search>(std::move(level), pool);
  const bool given = search->level().source.given_normals && search->level().reference.given_normals;
  search->take(search->proposer().of_matches({given ? Signs::given : Signs::spread, true}));
  search->finish();
  if (search->poses().empty() || !(search->poses()[0].fit.score > 0)) return nullptr;
  return search;
}

}  // namespace

Settled find_poses(const Prepared& source, const Prepared& reference, bool geometry, ThreadPool& pool) {
  const double reach = *std::max_element(std::begin(descriptor_radii), std::end(descriptor_radii));
  std::vector<Candidate> before;
  std::unique_ptr<Search> search;
  for (const std::size_t points : level_points) {
    auto level = levels(source, reference, points, reach, descriptor_neighbours, pool);
    if (search && level->source.resolution > least_gain * search->level().source.resolution) break;
    if (search) before = search->poses();
    search = std::make_unique<Search>(std::move(level), pool);
    search->take(before);
    if (!geometry) break;
    search->take(search->proposer().of_axes());
    for (const SignRule& rule : rules_for(search->level())) {
      search->take(search->proposer().of_matches(rule));
      std::vector<Candidate> turned;
      for (std::size_t i = 0; i < std::min(turned_over_from, search->poses().size()); ++i)
        for (Candidate& c : turned_over(search->level(), search->poses()[i])) turned.push_back(std::move(c));
      search->take(std::move(turned));
      if (search->believes(beyond_doubt)) break;
    }
    if (search->believes(likely)) break;
  }
  search->finish();
  if (geometry && pieces_of_solids(*search))
    if (auto touching =
            touch(levels(source, reference, level_points[1], reach, descriptor_neighbours, pool), pool))
      search = std::move(touching);
  return std::move(*search).result();
}

Settled with_more(Settled settled, std::vector<Candidate> candidates, ThreadPool& pool) {
  Search search(std::move(settled.level), pool);
  search.keep(std::move(settled.poses));
  search.take(std::move(candidates));
  search.finish();
  return std::move(search).result();
}

Settled within(const Restriction& restriction, Settled settled, ThreadPool& pool) {
  const std::vector<double> before = settled.confidences;
  const double most = before.empty() ? 0 : *std::max_element(before.begin(), before.end());
  for (Candidate& c : settled.poses) {
    c.T = restricted(restriction, c.T, {}).pose;
    c.fit = fit(settled.level->source, settled.level->reference, c.T);
  }
  Search search(std::move(settled.level), pool);
  search.keep(std::move(settled.poses));
  search.judge_all();
  Settled result = std::move(search).result();
  for (double& confidence : result.confidences) confidence = std::min(confidence, most);
  return result;
}

}  // namespace bitr::solving
