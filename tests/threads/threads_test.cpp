// Plans on one device, used from different threads at once: the answers are those of one thread, bit for bit. Under
// ThreadSanitizer (preset tsan) no two of them touch the same memory.
#include <array>
#include <bitr/kernels.hpp>
#include <functional>
#include <thread>

#include "property/network.hpp"

namespace bitr {
namespace {

constexpr int thread_count = 3, passes = 4;

using Bits = std::array<double, 12>;

Bits bits_of(const Pose& pose) {
  Bits bits;
  std::copy(pose.rotation.begin(), pose.rotation.end(), bits.begin());
  std::copy(pose.translation.begin(), pose.translation.end(), bits.begin() + 9);
  return bits;
}

struct Pair {
  test::ExactCloud source, reference;
};

std::vector<Pair> pairs() {
  Random random(71);
  std::vector<Pair> list;
  for (int i = 0; i < thread_count; ++i)
    list.push_back({test::exact_cloud(random, 120 + 30 * i), test::exact_cloud(random, 150 - 10 * i)});
  return list;
}

Bits pose_of(Plan& plan, const Pair& pair) {
  return bits_of(test::solve(plan, pair.source.view(), pair.reference.view()).T_reference_source);
}

void run_at_once(const std::function<void(int)>& body) {
  std::vector<std::thread> threads;
  for (int i = 0; i < thread_count; ++i) threads.emplace_back(body, i);
  for (std::thread& thread : threads) thread.join();
}

class Threads : public testing::TestWithParam<Backend> {
 protected:
  void SetUp() override {
    BITR_NEEDS(GetParam());
    device_.emplace(test::device_on(GetParam()));
    const auto model = untrained_model();
    ASSERT_TRUE(model) << model.error().message;
    model_.emplace(*model);
  }
  Plan plan() const { return test::plan_for(*model_, {}, *device_, {.pairs = 1, .points = 400}); }

  std::optional<Device> device_;
  std::optional<Model> model_;
  const std::vector<Pair> pairs_ = pairs();
};

TEST_P(Threads, PlansOnOneDeviceGiveWhatOneThreadGets) {
  std::vector<Bits> alone;
  for (const Pair& pair : pairs_) {
    Plan one = plan();
    alone.push_back(pose_of(one, pair));
  }
  ASSERT_NE(alone[0], alone[1]);

  std::vector<std::vector<Bits>> together(thread_count);
  run_at_once([&](int i) {
    Plan own = plan();
    for (int pass = 0; pass < passes; ++pass) together[i].push_back(pose_of(own, pairs_[i]));
  });
  for (int i = 0; i < thread_count; ++i) EXPECT_EQ(together[i], std::vector<Bits>(passes, alone[i])) << i;
}

TEST_P(Threads, APlanMadeHereRunsThere) {
  std::vector<Plan> plans;
  std::vector<Bits> here(thread_count), there(thread_count);
  for (int i = 0; i < thread_count; ++i) {
    plans.push_back(plan());
    here[i] = pose_of(plans[i], pairs_[i]);
  }
  run_at_once([&](int i) { there[i] = pose_of(plans[i], pairs_[i]); });
  EXPECT_EQ(there, here);
}

TEST_P(Threads, KernelsShareADevice) {
  const KnnShape shape{.k = 6};
  const auto lists_of = [&](const Pair& pair) {
    std::vector<float> points;
    for (const Vec3d& point : pair.source.positions) points.insert(points.end(), point.begin(), point.end());
    const auto lists = knn<float>(*device_, shape, Segments<float>{points});
    EXPECT_TRUE(lists) << (lists ? "" : lists.error().message);
    return lists.value_or(std::vector<std::uint32_t>{});
  };
  std::vector<std::vector<std::uint32_t>> alone(thread_count), together(thread_count);
  for (int i = 0; i < thread_count; ++i) alone[i] = lists_of(pairs_[i]);
  run_at_once([&](int i) { together[i] = lists_of(pairs_[i]); });
  EXPECT_EQ(together, alone);
}

INSTANTIATE_TEST_SUITE_P(Backends, Threads, testing::Values(Backend::cpu, Backend::vulkan),
                         [](const auto& backend) { return std::string(name(backend.param)); });

}  // namespace
}  // namespace bitr
