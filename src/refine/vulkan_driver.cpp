#include "refine/vulkan_driver.hpp"

#include <algorithm>
#include <map>
#include <optional>

#include "refine/vulkan_plans.hpp"
#include "vk/nearest.hpp"

namespace bitr::refine {
namespace {

constexpr std::size_t points_a_task = 256;
static_assert(Search::most_wanted == vk::Nearest::most_wanted);

/// What searches of all steppers want, as one submission.
class Searcher {
 public:
  Searcher(const vk::Context& context, ThreadPool& pool) : pool_(pool), nearest_(context) {}

  void run(const std::vector<const Search*>& searches) {
    if (searches.empty()) return;
    make_ready(searches);
    std::vector<vk::Nearest::Request> requests;
    std::vector<std::size_t> first = {0};  // query of each search
    for (const Search* search : searches) {
      requests.push_back(
          {clouds_.at(&search->in), static_cast<std::uint32_t>(search->wanted), search->count});
      first.push_back(first.back() + search->count);
    }
    nearest_.lay_out(requests);
    const auto for_each = [&](const auto& visit) {  // visit(search, its query)
      pool_.parallel_for(first.back(), points_a_task, [&](std::size_t begin, std::size_t end) {
        std::size_t s = std::upper_bound(first.begin(), first.end(), begin) - first.begin() - 1;
        for (std::size_t at = begin; at < end; ++at) {
          while (at >= first[s + 1]) ++s;
          visit(s, at - first[s]);
        }
      });
    };
    for_each([&](std::size_t s, std::size_t query) {
      const std::uint32_t i = orders_.at(searches[s]->from)[query];
      nearest_.cloud(requests[s].cloud).write(searches[s]->point(i), nearest_.queries(s) + 4 * query);
    });
    nearest_.run();
    for_each([&](std::size_t s, std::size_t query) {
      const std::uint32_t i = orders_.at(searches[s]->from)[query];
      tell(*searches[s], i, nearest_.cloud(requests[s].cloud),
           nearest_.found(s) + query * requests[s].wanted);
    });
  }

 private:
  /// Makes the trees of clouds that are new, and the order in which their points look.
  void make_ready(const std::vector<const Search*>& searches) {
    std::vector<const std::vector<Vec3d>*> clouds;
    std::vector<const Search*> looking;
    for (const Search* search : searches) {
      if (clouds_.emplace(&search->in, 0).second) clouds.push_back(&search->in);
      if (orders_.try_emplace(search->from).second) looking.push_back(search);
    }
    std::vector<std::optional<vk::Nearest::Cloud>> made(clouds.size());
    pool_.parallel_for(clouds.size() + looking.size(), 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i)
        if (i < clouds.size())
          made[i].emplace(*clouds[i]);
        else
          orders_.at(looking[i - clouds.size()]->from) = order_of(*looking[i - clouds.size()]);
    });
    for (std::size_t i = 0; i < clouds.size(); ++i) clouds_.at(clouds[i]) = nearest_.add(std::move(*made[i]));
  }

  static std::vector<std::uint32_t> order_of(const Search& search) {
    std::vector<Vec3d> points(search.count);
    for (std::size_t i = 0; i < points.size(); ++i) points[i] = search.point(i);
    return vk::Nearest::order_of(points);
  }

  static void tell(const Search& search, std::uint32_t i, const vk::Nearest::Cloud& cloud,
                   const std::uint32_t* found) {
    const Vec3d point = search.point(i);
    std::uint32_t index[Search::most_wanted];
    double squared[Search::most_wanted];
    std::size_t count = std::min(search.wanted, search.in.size());
    std::copy_n(found, count, index);
    if (!cloud.sees(point) || index[count - 1] == vk::Nearest::none) {
      count = nearest(search, point, index, squared);
    } else {
      for (std::size_t k = 0; k < count; ++k) {
        squared[k] = 0;
        for (int a = 0; a < 3; ++a) {
          const double difference = point[a] - search.in[index[k]][a];
          squared[k] += difference * difference;
        }
      }
    }
    search.take(i, index, squared, count);
  }

  ThreadPool& pool_;
  vk::Nearest nearest_;
  std::map<const std::vector<Vec3d>*, std::uint32_t> clouds_;
  std::map<const void*, std::vector<std::uint32_t>> orders_;
};

}  // namespace

void drive(std::span<Stepper* const> steppers, const vk::Context& context, ThreadPool& pool) {
  Searcher searcher(context, pool);
  VulkanPlans plans(context, pool);
  std::vector<Stepper*> going(steppers.begin(), steppers.end());
  const auto each = [&](const auto& visit) {
    pool.parallel_for(going.size(), 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) visit(i);
    });
  };
  while (!going.empty()) {
    std::vector<Wanted> wanted(going.size());
    each([&](std::size_t i) { wanted[i] = going[i]->wanted(); });
    std::vector<const Search*> searches;
    std::vector<PlanWanted*> planned;
    std::vector<Stepper*> next;
    for (std::size_t i = 0; i < going.size(); ++i) {
      if (wanted[i].nothing()) continue;
      next.push_back(going[i]);
      for (const Search& search : wanted[i].searches) searches.push_back(&search);
      if (wanted[i].plan) planned.push_back(wanted[i].plan);
    }
    going = std::move(next);
    searcher.run(searches);
    plans.run(planned);
    each([&](std::size_t i) { going[i]->step(); });
  }
}

}  // namespace bitr::refine
