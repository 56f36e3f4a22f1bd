// What must not matter at all, bit for bit: the number of threads, the pairs in the same batch, and how the
// caller's memory holds the numbers.
#include <cmath>
#include <cstring>

#include "property/network.hpp"

namespace bitr {
namespace {

using test::ExactCloud;
using test::Network;

// Every number of an assembly, for comparison of bits.
std::vector<double> numbers(const Assembly& a) {
  std::vector<double> all(a.T_reference_source.rotation.begin(), a.T_reference_source.rotation.end());
  const auto add = [&](const auto& values) { all.insert(all.end(), values.begin(), values.end()); };
  add(a.T_reference_source.translation);
  add(a.diagnostics.singular_values);
  for (const auto* optional : {&a.diagnostics.overlap, &a.diagnostics.inlier_rmse,
                               &a.diagnostics.inlier_threshold, &a.diagnostics.swap_residual})
    all.push_back(optional->value_or(-1));
  for (const auto* points : {&a.source_key_points, &a.reference_key_points})
    for (const Vec3d& p : *points) add(p);
  return all;
}

// Very different sizes side by side; 3500 points are past the limit of brute-force neighbours.
std::vector<std::pair<ExactCloud, ExactCloud>> uneven_clouds(Random& random, bool large) {
  std::vector<std::pair<ExactCloud, ExactCloud>> clouds;
  const std::size_t sizes[][2] = {{41, 700}, {1025, 64}, {130, 41}, {3500, 90}, {333, 1500}};
  for (const auto& [n, m] : sizes)
    if (large || n + m < 500) clouds.emplace_back(test::exact_cloud(random, n), test::exact_cloud(random, m));
  return clouds;
}

std::vector<CloudPair> views(const std::vector<std::pair<ExactCloud, ExactCloud>>& clouds) {
  std::vector<CloudPair> pairs;
  for (const auto& [x, y] : clouds) pairs.push_back({x.view(), y.view()});
  return pairs;
}

std::vector<std::vector<double>> run(Plan& plan, std::span<const CloudPair> pairs,
                                     const AssembleOptions& options = {}) {
  std::vector<std::vector<double>> results;
  const auto assemblies = assemble(plan, pairs, options);
  EXPECT_TRUE(assemblies) << (assemblies ? "" : assemblies.error().message);
  if (assemblies)
    for (const Assembly& assembly : *assemblies) results.push_back(numbers(assembly));
  return results;
}

Vec3f single(const Vec3d& v) {
  return {static_cast<float>(v[0]), static_cast<float>(v[1]), static_cast<float>(v[2])};
}

// Coordinates that float holds exactly. By arithmetic: GCC 12 at -O2 drops the rounding of double → float →
// double where it vectorises three of them.
PointCloud rounded(const ExactCloud& cloud) {
  PointCloud result;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    Vec3d p = cloud.positions[i];
    for (double& x : p) x = std::round(x * 0x1p20) * 0x1p-20;
    result.positions.push_back(p);
    result.normals.push_back(single(cloud.normals[i]));
    result.colors.push_back(single(cloud.colors[i]));
  }
  return result;
}

struct Kind {
  Network network;
  Precision precision;
  bool as_defined;
  Backend backend = Backend::cpu;

  std::string name() const {
    return std::string(network.name) + (precision == Precision::f32 ? "_f32" : "_f64") +
           (as_defined ? "_as_defined" : "") + (backend == Backend::vulkan ? "_vulkan" : "");
  }
  friend std::ostream& operator<<(std::ostream& out, const Kind& kind) { return out << kind.name(); }
};

std::vector<Kind> kinds() {
  std::vector<Kind> all;
  for (const Network& network : test::networks())
    for (const Precision precision : {Precision::f32, Precision::f64})
      all.push_back({network, precision, false});
  for (const Network& network : test::networks())
    all.push_back({network, Precision::f32, false, Backend::vulkan});
  all.push_back({test::networks()[1], Precision::f32, true});
  all.push_back({test::networks()[0], Precision::f64, true});
  return all;
}

class Batch : public testing::TestWithParam<Kind> {
 protected:
  void SetUp() override { BITR_NEEDS(GetParam().backend); }
  Device device(unsigned threads = 2) const { return test::device_on(GetParam().backend, threads); }
  PlanOptions options() const {
    return {.precision = GetParam().precision, .mode = {}, .as_defined = GetParam().as_defined};
  }
  Model model_ = untrained_model(GetParam().network.config, 4).value();
  Random random_{5};
  const std::vector<std::pair<ExactCloud, ExactCloud>> clouds_ =
      uneven_clouds(random_, !GetParam().as_defined);
};

TEST_P(Batch, ResultsDoNotDependOnTheNumberOfThreads) {
  const auto pairs = views(clouds_);
  Plan one = test::plan_for(model_, options(), device(1));
  const auto expected = run(one, pairs);
  for (const unsigned threads : {2u, 3u, 5u}) {
    const Device other = device(threads);
    ASSERT_EQ(other.threads(), threads);
    Plan plan = test::plan_for(model_, options(), other);
    EXPECT_EQ(run(plan, pairs), expected) << threads << " threads";
    EXPECT_EQ(run(plan, pairs), expected) << "again";
  }
}

TEST_P(Batch, APairAloneEqualsThePairInABatch) {
  const auto pairs = views(clouds_);
  Plan plan = test::plan_for(model_, options(), device());
  const auto batch = run(plan, pairs);
  ASSERT_EQ(batch.size(), pairs.size());
  for (std::size_t i = 0; i < pairs.size(); ++i)
    EXPECT_EQ(run(plan, {&pairs[i], 1}).at(0), batch[i]) << "pair " << i;
  // In another order, in a plan that holds no more, with every option that runs the network again.
  const std::vector<CloudPair> reversed(pairs.rbegin(), pairs.rend());
  const AssembleOptions all{.complete_match = true, .diagnostics = true, .swap_residual = true};
  Plan large = make_plan(device(), model_, shape_of(reversed), options()).value();
  const auto backwards = run(large, reversed, all);
  for (std::size_t i = 0; i < pairs.size(); ++i)
    EXPECT_EQ(run(large, {&reversed[i], 1}, all).at(0), backwards[i]) << "reversed pair " << i;
}

TEST_P(Batch, ViewsOfTheSameNumbersGiveTheSame) {
  struct Row {
    double id;
    double position[3];
    float normal[3];
    float rgb[3];
    char pad[4];
  };
  const PointCloud owned = rounded(clouds_.front().first), other = rounded(clouds_.front().second);
  std::vector<Vec3f> singles;
  std::vector<Row> rows;
  for (std::size_t i = 0; i < owned.size(); ++i) {
    const Vec3d& p = owned.positions[i];
    const Vec3f &n = owned.normals[i], &c = owned.colors[i];
    singles.push_back(single(p));
    rows.push_back({1e300, {p[0], p[1], p[2]}, {n[0], n[1], n[2]}, {c[0], c[1], c[2]}, {}});
  }
  Plan plan = test::plan_for(model_, options(), device());
  const CloudPair whole{owned, other};
  const auto expected = run(plan, {&whole, 1});

  CloudPair of_floats{owned, other};
  of_floats.source.positions = singles;
  EXPECT_EQ(run(plan, {&of_floats, 1}), expected);

  CloudPair strided{owned, other};
  strided.source.positions = Vec3View(rows[0].position, rows.size(), sizeof(Row), Scalar::f64);
  strided.source.normals = Vec3View(rows[0].normal, rows.size(), sizeof(Row), Scalar::f32);
  strided.source.colors = Vec3View(rows[0].rgb, rows.size(), sizeof(Row), Scalar::f32);
  EXPECT_EQ(run(plan, {&strided, 1}), expected);

  std::vector<Vec3d> normals;
  for (const Vec3f& n : owned.normals) normals.push_back({n[0], n[1], n[2]});
  CloudPair doubles{owned, other};
  doubles.source.normals = normals;
  EXPECT_EQ(run(plan, {&doubles, 1}), expected);

  // Not aligned to anything: packed records of a file, read where they lie.
  std::vector<std::byte> packed(1 + singles.size() * 13);
  for (std::size_t i = 0; i < singles.size(); ++i) std::memcpy(packed.data() + 1 + 13 * i, &singles[i], 12);
  CloudPair unaligned{owned, other};
  unaligned.source.positions = Vec3View(packed.data() + 1, singles.size(), 13, Scalar::f32);
  EXPECT_EQ(run(plan, {&unaligned, 1}), expected);
}

// A plan's memory is sized by its largest batch; smaller ones after it must not read what it left.
TEST_P(Batch, APlanForgetsEarlierBatches) {
  const auto pairs = views(clouds_);
  Plan used = test::plan_for(model_, options(), device()),
       fresh = test::plan_for(model_, options(), device());
  run(used, pairs);
  EXPECT_EQ(run(used, {&pairs[0], 1}), run(fresh, {&pairs[0], 1}));
}

INSTANTIATE_TEST_SUITE_P(Kinds, Batch, testing::ValuesIn(kinds()),
                         [](const auto& kind) { return kind.param.name(); });

}  // namespace
}  // namespace bitr
