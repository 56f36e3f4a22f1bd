// Whole passes: what the network promises, measured.
#include <algorithm>
#include <cmath>
#include <numeric>

#include "api/doctor.hpp"
#include "core/failure.hpp"
#include "core/guarded.hpp"
#include "core/random.hpp"

namespace bitr {
namespace {

constexpr double pass_degrees = 0.05;      // error of single precision on well determined rotations
constexpr double pass_translation = 1e-3;  // over the clouds' size and the translation itself
constexpr double least_gap = 0.3;          // that makes a rotation well determined

std::vector<Assembly> solve(Plan& plan, const std::vector<RandomPair>& pairs) {
  std::vector<CloudPair> views;
  views.reserve(pairs.size());
  for (const RandomPair& pair : pairs) views.push_back(pair.view());
  return value_or_throw(assemble(plan, views, {.diagnostics = false}));
}

Plan plan_for(const Device& device, const Model& model, const std::vector<RandomPair>& pairs,
              Precision precision = Precision::f32) {
  // Exchanged clouds need no more than the pairs themselves.
  BatchShape shape{pairs.size(), 0};
  for (const RandomPair& pair : pairs) shape.points += pair.source.size() + pair.reference.size();
  return value_or_throw(make_plan(device, model, shape, {.precision = precision}));
}

// A bent, uneven blob of about unit size.
std::vector<Vec3d> random_cloud(Random& random, std::size_t points) {
  const double bend = random.uniform(0.3, 0.8), stretch = random.uniform(0.4, 0.9);
  std::vector<Vec3d> cloud;
  for (std::size_t i = 0; i < points; ++i) {
    const double u = random.uniform(-1, 1), v = random.uniform(-1, 1) * (1 - 0.4 * u);
    cloud.push_back({u, stretch * v + bend * u * u, 0.4 * random.uniform(-1, 1) + 0.3 * u * v});
  }
  return cloud;
}

Pose random_pose(Random& random) {
  return {random.rotation(), {random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1)}};
}

std::vector<Vec3d> moved(std::vector<Vec3d> cloud, const Pose& pose) {
  for (Vec3d& p : cloud) p = pose.apply(p);
  return cloud;
}

std::vector<Vec3d> scaled(std::vector<Vec3d> cloud, double factor) {
  for (Vec3d& p : cloud)
    for (double& x : p) x *= factor;
  return cloud;
}

std::vector<Vec3d> shuffled(std::vector<Vec3d> cloud, Random& random) {
  for (std::size_t i = cloud.size(); i > 1; --i) std::swap(cloud[i - 1], cloud[random.below(i)]);
  return cloud;
}

bool same_bits(const Assembly& a, const Assembly& b) {
  return a.T_reference_source.rotation == b.T_reference_source.rotation &&
         a.T_reference_source.translation == b.T_reference_source.translation &&
         a.source_key_points == b.source_key_points && a.reference_key_points == b.reference_key_points;
}

class Passes {
 public:
  Passes(const Device& device, const Model& model, const std::vector<RandomPair>& pairs,
         std::vector<Check>& checks)
      : pairs_(pairs), checks_(checks), plan_(plan_for(device, model, pairs)) {
    Plan exact = plan_for(cpu_device(device.threads()), model, pairs, Precision::f64);
    truth_ = solve(exact, pairs);
    found_ = solve(plan_, pairs);
  }

  void check() {
    compare(
        "passes", [&](std::size_t i) { return truth_[i].T_reference_source; }, found_);
    check_motions();
    const auto inverse = [&](std::size_t i) { return pose(i).inverse(); };
    compare("exchanged clouds", inverse, solve(plan_, made([](const RandomPair& pair) {
                                                 return RandomPair{pair.reference, pair.source};
                                               })));
    check_scales();
    compare(
        "reordered points", [&](std::size_t i) { return pose(i); },
        solve(plan_, made([&](const RandomPair& pair) {
                return RandomPair{shuffled(pair.source, random_), shuffled(pair.reference, random_)};
              })));
    check_bits();
  }

 private:
  const Pose& pose(std::size_t i) const { return found_[i].T_reference_source; }
  template <class Make>
  std::vector<RandomPair> made(Make make) const {
    std::vector<RandomPair> all;
    for (const RandomPair& pair : pairs_) all.push_back(make(pair));
    return all;
  }

  // Against expected(pair), in lengths multiplied by `scale`.
  template <class Expected>
  void compare(const std::string& what, Expected expected, const std::vector<Assembly>& results,
               double scale = 1) {
    Check rotation{what + ", rotation in degrees", 0, pass_degrees, ""},
        translation{what + ", translation over the clouds' size", 0, pass_translation, ""};
    for (std::size_t i = 0; i < results.size(); ++i) {
      const Pose& a = results[i].T_reference_source;
      const Pose b = expected(i);
      const auto& t = b.translation;
      constexpr double cloud_size = 2;
      const double size = scale * 2 * cloud_size + std::hypot(t[0], t[1], t[2]);
      const double degrees = rotation_error_degrees(a, b), shift = translation_error(a, b) / size;
      // A NaN stays.
      if (!(degrees <= rotation.measured)) rotation.measured = degrees;
      if (!(shift <= translation.measured)) translation.measured = shift;
    }
    checks_.push_back(rotation);
    checks_.push_back(translation);
  }

  void check_motions() {
    std::vector<Pose> g1, g2;
    const auto turned = made([&](const RandomPair& pair) {
      g1.push_back(random_pose(random_));
      g2.push_back(random_pose(random_));
      return RandomPair{moved(pair.source, g1.back()), moved(pair.reference, g2.back())};
    });
    compare(
        "moved clouds", [&](std::size_t i) { return g2[i] * pose(i) * g1[i].inverse(); },
        solve(plan_, turned));
  }

  void check_scales() {
    for (const double scale : {1e-3, 37.0}) {
      const auto grown = made([&](const RandomPair& pair) {
        return RandomPair{scaled(pair.source, scale), scaled(pair.reference, scale)};
      });
      const auto expected = [&](std::size_t i) {
        Pose f = pose(i);
        for (double& t : f.translation) t *= scale;
        return f;
      };
      compare(scale < 1 ? "smaller clouds" : "larger clouds", expected, solve(plan_, grown), scale);
    }
  }

  void check_bits() {
    double again = 0, alone = 0;
    const auto repeated = solve(plan_, pairs_);
    for (std::size_t i = 0; i < pairs_.size(); ++i) {
      again += !same_bits(repeated[i], found_[i]);
      alone += !same_bits(solve(plan_, {pairs_[i]}).front(), found_[i]);
    }
    checks_.push_back({"pairs whose bits differ in another run", again, 0, ""});
    checks_.push_back({"pairs whose bits differ alone and in a batch", alone, 0, ""});
  }

  const std::vector<RandomPair>& pairs_;
  std::vector<Check>& checks_;
  Plan plan_;
  std::vector<Assembly> truth_, found_;
  Random random_{31};
};

}  // namespace

std::vector<RandomPair> doctor_pairs(const Model& model) {
  constexpr std::size_t sizes[][2] = {{25, 333}, {1025, 41}, {64, 65}, {300, 257}, {700, 512}};
  constexpr int most_draws = 200;
  Random random(17);
  const Device cpu = cpu_device(1);
  std::vector<RandomPair> pairs;
  for (const auto& [n, m] : sizes) {
    for (int draw = 0; draw < most_draws; ++draw) {
      const RandomPair pair{random_cloud(random, n), random_cloud(random, m)};
      Plan exact = plan_for(cpu, model, {pair}, Precision::f64);
      if (solve(exact, {pair}).front().diagnostics.rotation_gap < least_gap) continue;
      pairs.push_back(pair);
      break;
    }
  }
  return pairs;
}

std::vector<std::vector<RandomPair>> large_batches() {
  Random random(19);
  const auto pair = [&](std::size_t n, std::size_t m) {
    return RandomPair{random_cloud(random, n), random_cloud(random, m)};
  };
  return {{pair(512, 512)}, {pair(5000, 500)}};
}

void check_passes(const Device& device, const Model& model, const std::vector<RandomPair>& pairs,
                  std::vector<Check>& checks) {
  try {
    Passes(device, model, pairs, checks).check();
  } catch (const Failure& failure) {
    if (failure.error().code == ErrorCode::device_lost) throw;
    checks.push_back({"whole passes", 0, 0, failure.what()});
  }
}

}  // namespace bitr
