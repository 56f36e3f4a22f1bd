// Untrained networks of several configurations, run through the public interface.
#pragma once

#include <gtest/gtest.h>

#include <bitr/bitr.hpp>
#include <ostream>
#include <span>
#include <string>

#include "api/internal.hpp"
#include "core/thread_pool.hpp"
#include "support/random_motion.hpp"
#include "support/shapes.hpp"
#include "support/vulkan.hpp"

namespace bitr::test {

struct Network {
  const char* name;
  ModelConfig config;
  friend std::ostream& operator<<(std::ostream& out, const Network& network) { return out << network.name; }
};

inline const std::vector<Network>& networks() {
  static const std::vector<Network> all = [] {
    std::vector<Network> list = {{"official", {}}};
    ModelConfig c;
    c.return_normals = true;
    list.push_back({"normals", c});
    c.get_color = true;
    c.key_global_merge_coe = 8;
    list.push_back({"normals_and_colours", c});
    c = {};
    c.num_layers = c.feature_num_layers = 0;
    c.k_neighbor = 5;
    c.key_mean_num = 3;
    c.num_key_points = 8;
    c.re_convert_k = 5;
    list.push_back({"shallow", c});
    c = {};
    c.num_channels = 6;
    c.feature_num_channels = 3;
    c.predict_head = 1;
    c.div = c.heads = 1;
    c.num_layers = c.feature_num_layers = 1;
    c.k_neighbor = 40;
    c.key_mean_num = 17;
    c.num_key_points = 20;
    c.re_convert_k = 9;
    c.key_global_merge_coe = 1;
    list.push_back({"uneven", c});
    return list;
  }();
  return all;
}

inline std::size_t least_points(const ModelConfig& config) {
  return static_cast<std::size_t>(
      std::max(config.k_neighbor * config.neighbor_dilation + 1, config.key_mean_num));
}

inline Device shared_device() {
  static const Device device = cpu_device(2);
  return device;
}

/// A backend that a test runs on; `present` is false for Vulkan where no device is.
inline bool present(Backend backend) { return backend == Backend::cpu || vulkan(); }
#define BITR_NEEDS(backend) \
  if (!test::present(backend)) GTEST_SKIP() << "no Vulkan device"

inline Device device_on(Backend backend, unsigned threads = 2) {
  if (backend == Backend::cpu) return cpu_device(threads);
  return Internal::device(std::make_shared<ThreadPool>(threads), vulkan());
}

inline Plan plan_for(const Model& model, const PlanOptions& options, const Device& device = shared_device(),
                     const BatchShape& capacity = {.pairs = 16, .points = 10000}) {
  auto plan = make_plan(device, model, capacity, options);
  EXPECT_TRUE(plan) << (plan ? "" : plan.error().message);
  return std::move(*plan);
}

inline Assembly solve(Plan& plan, const CloudView& source, const CloudView& reference,
                      AssembleOptions options = {.diagnostics = false}) {
  const CloudPair pair{source, reference};
  const auto result = assemble(plan, {&pair, 1}, options);
  EXPECT_TRUE(result) << (result ? "" : result.error().message);
  return result ? result->front() : Assembly{};
}

/// Largest differences over all comparisons of a test, kept in its report.
class Residuals {
 public:
  /// Entries of the rotation, and of the translation in units of `size`.
  void expect_near(const Pose& a, const Pose& b, double size, double bound, const std::string& what) {
    double rotation = 0, translation = 0;
    for (int i = 0; i < 9; ++i) rotation = worse(rotation, a.rotation[i] - b.rotation[i]);
    for (int i = 0; i < 3; ++i)
      translation = worse(translation, (a.translation[i] - b.translation[i]) / size);
    EXPECT_LE(rotation, bound) << what;
    EXPECT_LE(translation, bound) << what;
    rotation_ = worse(rotation_, rotation);
    translation_ = worse(translation_, translation);
  }
  ~Residuals() {
    testing::Test::RecordProperty("rotation", std::to_string(rotation_ * 1e15) + "e-15");
    testing::Test::RecordProperty("translation", std::to_string(translation_ * 1e15) + "e-15");
  }

 private:
  // Keeps a NaN.
  static double worse(double a, double b) { return a >= std::abs(b) ? a : std::abs(b); }
  double rotation_ = 0, translation_ = 0;
};

}  // namespace bitr::test
