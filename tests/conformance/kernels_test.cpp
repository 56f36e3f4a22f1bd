// The kernels that stand alone, through the public API: one list of cases for the CPU in float and in double
// and for Vulkan, against plain loops in double.
#include <bitr/kernels.hpp>
#include <cmath>
#include <numeric>
#include <optional>

#include "api/internal.hpp"
#include "irreps/clebsch_gordan.hpp"
#include "irreps/rotation.hpp"
#include "ops/op.hpp"
#include "support/plain_knn.hpp"
#include "support/random_motion.hpp"
#include "support/vulkan.hpp"

namespace bitr {
namespace {

using Index = std::vector<std::uint32_t>;
using Sizes = std::vector<std::uint32_t>;

struct CpuFloat {
  using Number = float;
  static std::optional<Device> device() { return cpu_device(2); }
};
struct CpuDouble {
  using Number = double;
  static std::optional<Device> device() { return cpu_device(2); }
};
struct Vulkan {
  using Number = float;
  static std::optional<Device> device() {
    if (!test::vulkan()) return std::nullopt;
    return Internal::device(std::make_shared<ThreadPool>(1), test::vulkan());
  }
};

Sizes offsets_of(const Sizes& sizes) {
  Sizes offsets = {0};
  for (const std::uint32_t size : sizes) offsets.push_back(offsets.back() + size);
  return offsets;
}

template <class T>
std::vector<T> numbers(Random& random, std::size_t count) {
  std::vector<T> all;
  for (std::size_t i = 0; i < count; ++i) all.push_back(static_cast<T>(random.uniform(-1, 1)));
  return all;
}

Index random_index(Random& random, std::size_t count, std::size_t rows) {
  Index index;
  for (std::size_t i = 0; i < count; ++i) index.push_back(static_cast<std::uint32_t>(random.below(rows)));
  return index;
}

template <class T>
T value_of(const Result<T>& result) {
  EXPECT_TRUE(result) << result.error().message;
  return result ? *result : T();
}

template <class T>
class Cases : public testing::Test {
 protected:
  static constexpr bool single = std::is_same_v<T, float>;
  const Device& device() const { return *device_; }

  // ---- knn

  // A lattice makes most distances tie; 0: none.
  std::vector<T> points(std::size_t count, int dim, int lattice) {
    std::vector<T> all = numbers<T>(random_, count * dim);
    if (lattice)
      for (T& x : all) x = std::round(x * T(lattice)) / T(8);
    return all;
  }
  void check_self(int k, int dim, const Sizes& sizes, int lattice, std::size_t step = 1) {
    const Sizes offsets = offsets_of(sizes);
    const std::vector<T> all = points(offsets.back(), dim, lattice);
    const Index index = value_of(knn<T>(device(), {.k = k, .dim = dim}, {all, offsets}));
    check_neighbors(index, all, offsets, all, offsets, true, k, dim, step);
    if (step > 1) return;  // many points
    for (const NeighborSearch search : {NeighborSearch::brute_force, NeighborSearch::tree})
      EXPECT_EQ(value_of(knn<T>(device(), {.k = k, .dim = dim, .search = search}, {all, offsets})), index);
  }
  void check_queries(int k, int dim, const Sizes& query_sizes, const Sizes& sizes, int lattice) {
    const Sizes offsets = offsets_of(sizes), query_offsets = offsets_of(query_sizes);
    const std::vector<T> references = points(offsets.back(), dim, lattice),
                         queries = points(query_offsets.back(), dim, lattice);
    const Index index =
        value_of(knn<T>(device(), {.k = k, .dim = dim}, {queries, query_offsets}, {references, offsets}));
    check_neighbors(index, queries, query_offsets, references, offsets, false, k, dim, 1);
  }
  void check_neighbors(const Index& index, const std::vector<T>& queries, const Sizes& query_offsets,
                       const std::vector<T>& references, const Sizes& offsets, bool without_self, int k,
                       int dim, std::size_t step) {
    ASSERT_EQ(index.size(), std::size_t{query_offsets.back()} * k);
    for (std::size_t s = 0; s + 1 < offsets.size(); ++s)
      for (std::size_t row = query_offsets[s]; row < query_offsets[s + 1]; row += step)
        ASSERT_EQ(Index(index.begin() + row * k, index.begin() + (row + 1) * k),
                  test::nearest_rows(&queries[row * dim], references.data(), offsets[s], offsets[s + 1],
                                     without_self ? row : std::size_t(-1), k, dim))
            << "row " << row << ", k " << k << ", dim " << dim;
  }

  // ---- cg_product

  struct Product {
    CgProductShape shape;
    std::vector<T> a, b;
    Index index;
    std::size_t entries;

    CgProductInput<T> input() const { return {a, b, index}; }
  };
  Product random_product(const CgProductShape& shape, std::size_t rows, std::size_t results) {
    const std::size_t entries = shape.k ? results * shape.k : rows;
    return {shape, numbers<T>(random_, rows * shape.channels * shape.a.dim()),
            numbers<T>(random_, entries * (shape.shared_b ? 1 : shape.channels) * shape.b.dim()),
            random_index(random_, shape.k ? entries : 0, rows), entries};
  }
  // Compares every `step`-th entry; `results`: rows of neighbours, if there are any.
  void check_product(const CgProductShape& shape, std::size_t rows, std::size_t results = 0,
                     std::size_t step = 1) {
    const Product p = random_product(shape, rows, results);
    const std::vector<T> out = value_of(cg_product<T>(device(), shape, p.input()));
    const auto [a, b, c] = std::array{shape.a, shape.b, shape.out};
    ASSERT_EQ(out.size(), p.entries * shape.channels * c.dim());
    const Eigen::MatrixXd q1 = irreps::clebsch_gordan_block(a.p, b.p, c.p),
                          q2 = irreps::clebsch_gordan_block(a.q, b.q, c.q);
    const auto side = [](int degree) { return 2 * degree + 1; };
    double worst = 0, largest = 0;
    for (std::size_t e = 0; e < p.entries; e += step)
      for (int channel = 0; channel < shape.channels; ++channel) {
        const T* left = &p.a[((shape.k ? p.index[e] : e) * shape.channels + channel) * a.dim()];
        const T* right = &p.b[(shape.shared_b ? e : e * shape.channels + channel) * b.dim()];
        const T* got = &out[(e * shape.channels + channel) * c.dim()];
        for (int m1 = 0; m1 < side(c.p); ++m1)
          for (int m2 = 0; m2 < side(c.q); ++m2) {
            double sum = 0, size = 0;
            for (int i1 = 0; i1 < side(a.p); ++i1)
              for (int i2 = 0; i2 < side(a.q); ++i2)
                for (int j1 = 0; j1 < side(b.p); ++j1)
                  for (int j2 = 0; j2 < side(b.q); ++j2) {
                    const double term = q1(i1 * side(b.p) + j1, m1) * q2(i2 * side(b.q) + j2, m2) *
                                        double(left[i1 * side(a.q) + i2]) *
                                        double(right[j1 * side(b.q) + j2]);
                    sum += term;
                    size += std::abs(term);
                  }
            worst = std::max(worst, std::abs(double(got[m1 * side(c.q) + m2]) - sum));
            largest = std::max(largest, size);
          }
      }
    EXPECT_LE(worst, (single ? ops::CgProduct{}.float_error() : 1e-14) * largest);
    record("cg_product", worst / largest);
  }

  // ---- attention

  struct Attended {
    AttentionShape shape;
    std::vector<T> queries, keys, values;
    Index index;

    AttentionInput<T> input() const { return {queries, keys, values, index}; }
  };
  Attended random_attention(const AttentionShape& shape, std::size_t queries, std::size_t rows) {
    const auto d = static_cast<std::size_t>(shape.heads) * shape.key_width,
               v = static_cast<std::size_t>(shape.heads) * shape.value_width;
    return {shape, numbers<T>(random_, queries * d), numbers<T>(random_, rows * d),
            numbers<T>(random_, rows * v), random_index(random_, queries * shape.k, rows)};
  }
  void check_attention(const AttentionShape& shape, std::size_t queries, std::size_t rows,
                       std::size_t step = 1) {
    const Attended in = random_attention(shape, queries, rows);
    const std::vector<T> out = value_of(attention<T>(device(), shape, in.input()));
    const int D = shape.key_width, V = shape.value_width, k = shape.k;
    ASSERT_EQ(out.size(), queries * shape.heads * V);
    double worst = 0;
    for (std::size_t row = 0; row < queries; row += step)
      for (int h = 0; h < shape.heads; ++h) {
        std::vector<double> weights, sums(V, 0.0);
        for (int j = 0; j < k; ++j) {
          double logit = 0;
          for (int i = 0; i < D; ++i)
            logit += double(in.queries[(row * shape.heads + h) * D + i]) *
                     double(in.keys[(in.index[row * k + j] * shape.heads + h) * D + i]);
          weights.push_back(shape.scale * logit);
        }
        const double peak = *std::max_element(weights.begin(), weights.end());
        double total = 0;
        for (double& w : weights) total += w = std::exp(w - peak);
        for (int j = 0; j < k; ++j)
          for (int i = 0; i < V; ++i)
            sums[i] +=
                weights[j] / total * double(in.values[(in.index[row * k + j] * shape.heads + h) * V + i]);
        for (int i = 0; i < V; ++i)
          worst = std::max(worst, std::abs(double(out[(row * shape.heads + h) * V + i]) - sums[i]));
      }
    EXPECT_LE(worst, single ? ops::NeighbourAttention{}.float_error() : 1e-14);  // values are at most 1
    record("attention", worst);
  }

  void record(const std::string& kernel, double error) {
    worst_[kernel] = std::max(worst_[kernel], error);
    this->RecordProperty(kernel,
                         std::to_string(worst_[kernel] * (single ? 1e9 : 1e18)) + (single ? "e-9" : "e-18"));
  }

  std::optional<Device> device_;
  Random random_{17};
  std::map<std::string, double> worst_;
};

template <class On>
class Kernels : public Cases<typename On::Number> {
 protected:
  void SetUp() override {
    this->device_ = On::device();
    if (!this->device_) GTEST_SKIP() << "no Vulkan here";
  }
};

using Backends = testing::Types<CpuFloat, CpuDouble, Vulkan>;
struct BackendNames {
  template <class On>
  static std::string GetName(int) {
    return std::is_same_v<On, Vulkan> ? "Vulkan" : std::is_same_v<On, CpuFloat> ? "CpuFloat" : "CpuDouble";
  }
};
TYPED_TEST_SUITE(Kernels, Backends, BackendNames);

TYPED_TEST(Kernels, NeighboursInEveryDimension) {
  for (int dim = 1; dim <= 8; ++dim)
    for (const int k : {1, 5, 24})
      for (const int lattice : {0, 4}) {
        const auto n = static_cast<std::uint32_t>(k);
        this->check_self(k, dim, {n + 1, 0, n + 2, 31, 32, 33, 65, 250}, lattice);
        this->check_queries(k, dim, {1, 0, 33, 5, 70}, {n, 0, n + 1, 32, 260}, lattice);
      }
}

TYPED_TEST(Kernels, NeighboursOfEveryNumber) {
  for (const int k : {2, 3, 8, 31, 32, 33, 63, 64}) {
    const auto n = static_cast<std::uint32_t>(k);
    this->check_self(k, 3, {n + 1, n + 2, 100}, 4);
    this->check_queries(k, 2, {0, 1, 3, 64}, {0, n, n + 1, n + 40}, 0);
  }
}

TYPED_TEST(Kernels, NeighboursWithoutSegments) {
  const auto points = this->points(90, 3, 0);
  const Index offsets = {0, 90};
  EXPECT_EQ(value_of(knn<typename TypeParam::Number>(this->device(), {.k = 4}, {points})),
            value_of(knn<typename TypeParam::Number>(this->device(), {.k = 4}, {points, offsets})));
}

TYPED_TEST(Kernels, NeighboursOfSeventyThousandPoints) { this->check_self(8, 3, {70001, 9, 33}, 0, 1733); }

// Products that exist: |a − b| ≤ out ≤ a + b, all of degree ≤ 2.
std::vector<std::array<int, 3>> triples() {
  std::vector<std::array<int, 3>> all;
  for (int a = 0; a <= 2; ++a)
    for (int b = 0; b <= 2; ++b)
      for (int out = std::abs(a - b); out <= std::min(a + b, 2); ++out) all.push_back({a, b, out});
  return all;
}

CgProductShape product_of(const std::array<int, 3>& p, const std::array<int, 3>& q) {
  return {.a = {p[0], q[0]}, .b = {p[1], q[1]}, .out = {p[2], q[2]}};
}

TYPED_TEST(Kernels, OneSidedProducts) {
  for (const auto& triple : triples())
    for (const bool shared : {false, true}) {
      CgProductShape shape = product_of(triple, {});
      shape.shared_b = shared;
      shape.channels = shared ? 3 : 4;
      for (const std::size_t rows : {1, 31, 65}) this->check_product(shape, rows);
      shape.k = 5;
      this->check_product(shape, 40, 33);
    }
}

TYPED_TEST(Kernels, TwoSidedProducts) {
  for (const auto& q : triples()) {
    CgProductShape shape = product_of({1, 2, 2}, q);
    this->check_product(shape, 70);
    std::swap(shape.a, shape.b);
    shape.channels = 2;
    shape.k = 24;
    this->check_product(shape, 9, 7);
  }
  this->check_product(product_of({2, 2, 2}, {2, 2, 2}), 300);
}

TYPED_TEST(Kernels, ProductsOfManyRowsAndChannels) {
  CgProductShape shape = product_of({1, 1, 1}, {});
  shape.channels = 4;
  this->check_product(shape, 70001, 0, 7);
  shape.channels = 1024;
  this->check_product(shape, 65);
  shape = product_of({0, 1, 1}, {});
  shape.k = 64;
  this->check_product(shape, 3, 1111);
}

// Larger than what lavapipe binds at once, 128 MiB.
TYPED_TEST(Kernels, ProductsBeyondOneBinding) {
  CgProductShape shape = product_of({1, 1, 2}, {});
  shape.channels = 4;
  shape.shared_b = true;
  shape.k = 24;
  this->check_product(shape, 1000, 70001, 1733);
}

TYPED_TEST(Kernels, ProductsTurnWithTheirFeatures) {
  using T = typename TypeParam::Number;
  constexpr std::size_t rows = 3;
  for (const auto& p : triples())
    for (const auto& q : triples()) {
      const CgProductShape shape = product_of(p, q);
      const auto product = this->random_product(shape, rows, 0);
      const Eigen::Matrix3d R1 = test::random_rotation(this->random_),
                            R2 = test::random_rotation(this->random_);
      const auto turned = [&](const std::vector<T>& features, Degree degree) {
        using RowMajor = Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
        const Eigen::MatrixXd D = irreps::wigner(degree, R1, R2);
        std::vector<T> result(features.size());
        Eigen::Map<RowMajor>(result.data(), rows, degree.dim()) =
            (Eigen::Map<const RowMajor>(features.data(), rows, degree.dim()).template cast<double>() *
             D.transpose())
                .template cast<T>();
        return result;
      };
      const auto a = turned(product.a, shape.a), b = turned(product.b, shape.b);
      const auto first = turned(value_of(cg_product<T>(this->device(), shape, product.input())), shape.out);
      const auto last = value_of(cg_product<T>(this->device(), shape, {a, b}));
      ASSERT_EQ(first.size(), last.size());
      for (std::size_t i = 0; i < first.size(); ++i)
        ASSERT_NEAR(first[i], last[i], this->single ? 1e-5 : 1e-13)
            << shape.a.str() << " x " << shape.b.str() << " -> " << shape.out.str();
    }
}

// What the header says about the products of two vectors.
TYPED_TEST(Kernels, ProductsOfVectors) {
  using T = typename TypeParam::Number;
  const std::vector<T> a = {1, 2, 3}, b = {T(0.5), -1, 4};  // (y, z, x)
  const auto dot = value_of(cg_product<T>(this->device(), {.a = {1}, .b = {1}, .out = {0}}, {a, b}));
  ASSERT_EQ(dot.size(), 1u);
  EXPECT_NEAR(dot[0], -10.5 / std::sqrt(3.0), 1e-6);
  const auto cross = value_of(cg_product<T>(this->device(), {.a = {1}, .b = {1}, .out = {1}}, {a, b}));
  ASSERT_EQ(cross.size(), 3u);
  const double expected[] = {11, -2.5, -2};
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(cross[i], expected[i] / std::sqrt(2.0), 2e-6) << i;
}

TYPED_TEST(Kernels, AttentionOfManyShapes) {
  this->check_attention({.k = 1}, 1, 1);
  this->check_attention({.heads = 2, .key_width = 16, .value_width = 8, .scale = 0.25}, 333, 100);
  this->check_attention({.heads = 3, .key_width = 5, .value_width = 7, .k = 64}, 31, 65);
  this->check_attention({.heads = 1, .key_width = 3, .value_width = 130, .k = 7}, 32, 8);
  this->check_attention({.heads = 64, .key_width = 2, .value_width = 1, .k = 33}, 9, 200);
  this->check_attention({.heads = 1, .key_width = 1024, .value_width = 1024, .k = 64, .scale = 0.1}, 17, 70);
  // Logits up to 30, of both signs.
  this->check_attention({.heads = 2, .key_width = 6, .value_width = 4, .k = 24, .scale = 8}, 500, 500);
  this->check_attention({.heads = 2, .key_width = 6, .value_width = 4, .k = 24, .scale = -8}, 500, 500);
  this->check_attention({.heads = 1, .key_width = 9, .value_width = 3, .k = 9, .scale = 0}, 12, 12);
}

TYPED_TEST(Kernels, AttentionOfSeventyThousandQueries) {
  this->check_attention({.heads = 2, .key_width = 4, .value_width = 6, .k = 8}, 70001, 70001, 17);
}

// A row's bits do not depend on where it is, nor on what else is there.
TYPED_TEST(Kernels, RowsAreIndependent) {
  using T = typename TypeParam::Number;
  const auto tail = []<class N>(const std::vector<N>& all, std::size_t from) {
    return std::vector<N>(all.begin() + from, all.end());
  };
  constexpr std::size_t first = 13;

  CgProductShape product = product_of({1, 2, 2}, {1, 1, 0});
  product.channels = 3;
  product.k = 4;
  const auto p = this->random_product(product, 50, 77);
  const Index edges = tail(p.index, first * 4);
  const std::vector<T> b = tail(p.b, first * 4 * 3 * product.b.dim());
  EXPECT_EQ(
      value_of(cg_product<T>(this->device(), product, {p.a, b, edges})),
      tail(value_of(cg_product<T>(this->device(), product, p.input())), first * 4 * 3 * product.out.dim()));

  const AttentionShape shape{.heads = 3, .key_width = 5, .value_width = 9, .k = 6};
  const auto in = this->random_attention(shape, 77, 50);
  const Index index = tail(in.index, first * 6);
  const std::vector<T> queries = tail(in.queries, first * 15);
  EXPECT_EQ(value_of(attention<T>(this->device(), shape, {queries, in.keys, in.values, index})),
            tail(value_of(attention<T>(this->device(), shape, in.input())), first * 27));
}

TYPED_TEST(Kernels, NothingInNothingOut) {
  using T = typename TypeParam::Number;
  EXPECT_EQ(value_of(knn<T>(this->device(), {.k = 3}, {})), Index());
  EXPECT_EQ(value_of(knn<T>(this->device(), {.k = 3, .search = NeighborSearch::tree}, {})), Index());
  EXPECT_EQ(value_of(cg_product<T>(this->device(), {.a = {1}, .b = {1}, .out = {1}}, {})), std::vector<T>());
  EXPECT_EQ(value_of(attention<T>(this->device(), {}, {})), std::vector<T>());
}

// One kernel for calls of many sizes: the same results, and no more memory once it has grown.
TYPED_TEST(Kernels, KeptKernels) {
  using T = typename TypeParam::Number;
  auto search = make_knn<T>(this->device(), {.k = 3, .dim = 2});
  ASSERT_TRUE(search);
  EXPECT_EQ(search->workspace_bytes(), 0u);
  for (const Sizes& sizes : {Sizes{9}, Sizes{4, 50, 4}, Sizes{300, 5}, Sizes{20}, Sizes{4, 4, 4, 4, 4}}) {
    const Sizes offsets = offsets_of(sizes);
    const auto points = this->points(offsets.back(), 2, 0), queries = this->points(7 * sizes.size(), 2, 0);
    const Sizes query_offsets = offsets_of(Sizes(sizes.size(), 7));
    Index index(3 * offsets.back()), found(21 * sizes.size());
    ASSERT_TRUE(search->run({points, offsets}, index));
    ASSERT_TRUE(search->run({queries, query_offsets}, {points, offsets}, found));
    this->check_neighbors(index, points, offsets, points, offsets, true, 3, 2, 1);
    this->check_neighbors(found, queries, query_offsets, points, offsets, false, 3, 2, 1);
  }
  auto attend = make_attention<T>(this->device(), {.heads = 2, .key_width = 3, .value_width = 5, .k = 4});
  ASSERT_TRUE(attend);
  std::size_t bytes = 0;
  for (const std::size_t rows : {500, 9, 500, 300}) {
    const auto in =
        this->random_attention({.heads = 2, .key_width = 3, .value_width = 5, .k = 4}, rows, rows);
    std::vector<T> out(rows * 10);
    ASSERT_TRUE(attend->run(in.input(), out));
    EXPECT_EQ(out, value_of(attention<T>(this->device(), in.shape, in.input())));
    ASSERT_TRUE(attend->run(in.input(), out));
    if (bytes == 0) bytes = attend->workspace_bytes();
    EXPECT_EQ(attend->workspace_bytes(), bytes);
    const std::size_t allocations = test::vulkan() ? test::vulkan()->allocations() : 0;
    ASSERT_TRUE(attend->run(in.input(), out));
    EXPECT_EQ(test::vulkan() ? test::vulkan()->allocations() : 0, allocations);
  }
}

template <class T>
void expect_error(const Result<T>& result, const std::string& part) {
  ASSERT_FALSE(result) << part;
  EXPECT_EQ(result.error().code, ErrorCode::invalid_argument) << result.error().message;
  EXPECT_NE(result.error().message.find(part), std::string::npos) << result.error().message;
}

TYPED_TEST(Kernels, BadNeighbourSearches) {
  using T = typename TypeParam::Number;
  const auto points = this->points(20, 3, 0);
  const auto search = [&](const KnnShape& shape, const Segments<T>& segments) {
    return knn<T>(this->device(), shape, segments);
  };
  const auto ask = [&](const KnnShape& shape, const Segments<T>& queries, const Segments<T>& references) {
    return knn<T>(this->device(), shape, queries, references);
  };
  expect_error(search({.k = 0}, {points}), "k is 0, must be 1 … 64");
  expect_error(search({.k = 65}, {points}), "k is 65");
  expect_error(search({.k = 4, .dim = 9}, {points}), "dim is 9, must be 1 … 8");
  expect_error(search({.k = 4, .dim = 7}, {points}), "60 numbers are not rows of 7");
  expect_error(search({.k = 20}, {points}), "segment 0 has 20 points, k = 20 needs at least 21");
  const Sizes fine = {0, 9, 20}, none = {0, 9, 9, 20}, late = {1, 20}, back = {0, 9, 8, 20}, few = {0, 9, 19},
              short_one = {0, 9, 13, 20};
  EXPECT_TRUE(search({.k = 8}, {points, fine}));
  EXPECT_TRUE(search({.k = 8}, {points, none}));
  expect_error(search({.k = 4}, {points, short_one}), "segment 1 has 4 points, k = 4 needs at least 5");
  expect_error(search({.k = 4}, {points, late}), "offset 0 is 1, must be 0");
  expect_error(search({.k = 4}, {points, back}), "offset 2 is 8, must be at least the one before it, 9");
  expect_error(search({.k = 4}, {points, few}), "offset 2 is 19, must be the number of points, 20");
  EXPECT_TRUE(ask({.k = 9}, {points, fine}, {points, fine}));
  expect_error(ask({.k = 10}, {points, fine}, {points, fine}), "segment 0 has 9 references, k = 10");
  expect_error(ask({.k = 4}, {points}, {points, fine}), "queries have 1 segments, references 2");
  expect_error(ask({.k = 4}, {points, fine}, {}), "queries have 2 segments, references 1");
  for (const double bad : {std::nan(""), HUGE_VAL, -HUGE_VAL, this->single ? 1.1e18 : 1.1e150}) {
    auto wrong = points;
    wrong[17] = static_cast<T>(bad);
    expect_error(search({.k = 4}, {wrong}), "points: point 5 has a coordinate of");
    expect_error(ask({.k = 4}, {wrong}, {points}), "queries: point 5");
    expect_error(ask({.k = 4}, {points}, {wrong}), "references: point 5");
  }
  auto kernel = make_knn<T>(this->device(), {.k = 4});
  ASSERT_TRUE(kernel);
  Index index(79);
  expect_error(kernel->run({points}, index), "index has 79 numbers, must have 80");
}

TYPED_TEST(Kernels, BadProducts) {
  using T = typename TypeParam::Number;
  const std::vector<T> a(36), b(36);
  const Index index = {0, 1, 5, 0}, beyond = {0, 1, 6, 0};
  const auto multiply = [&](const CgProductShape& shape, const CgProductInput<T>& input) {
    return cg_product<T>(this->device(), shape, input);
  };
  const CgProductShape good{.a = {1}, .b = {1}, .out = {1}, .channels = 2};
  EXPECT_TRUE(multiply(good, {a, b}));
  const auto with = [&](auto change) {
    CgProductShape shape = good;
    change(shape);
    return shape;
  };
  expect_error(multiply(with([](auto& s) { s.out.p = 3; }), {a, b}), "p of out is 3, must be 0 … 2");
  expect_error(multiply(with([](auto& s) { s.a.p = 3; }), {a, b}), "p of a is 3, must be 0 … 2");
  expect_error(multiply(with([](auto& s) { s.b.q = -1; }), {a, b}), "q of b is -1, must be 0 … 2");
  expect_error(multiply(with([](auto& s) { s.out.q = 1; }), {a, b}), "q of out is 1, must be 0 … 0");
  expect_error(multiply(with([](auto& s) { s.channels = 0; }), {a, b}), "channels is 0");
  expect_error(multiply(with([](auto& s) { s.channels = 2147483647; }), {a, b}), "channels is 2147483647");
  expect_error(multiply(with([](auto& s) { s.k = -1; }), {a, b}), "k is -1, must be 0 … 64");
  expect_error(multiply(with([](auto& s) { s.channels = 5; }), {a, b}), "a: 36 numbers are not rows of 15");
  expect_error(multiply(with([](auto& s) { s.shared_b = true; }), {a, b}), "b has 36 numbers, must have 18");
  expect_error(multiply(good, {a, b, index}), "there is an index, but k is 0");
  const CgProductShape edges = with([](auto& s) { s.k = 2; });
  const std::span<const T> four = std::span(b).first(24);
  EXPECT_TRUE(multiply(edges, {a, four, index}));
  expect_error(multiply(edges, {a, four, beyond}), "index: entry 2 is 6, of 6 rows");
  expect_error(multiply(edges, {a, b, index}), "b has 36 numbers, must have 24");
  expect_error(multiply(edges, {a, b, std::span(index).first(3)}), "index: 3 numbers are not rows of 2");
  auto kernel = make_cg_product<T>(this->device(), good);
  ASSERT_TRUE(kernel);
  std::vector<T> out(35);
  expect_error(kernel->run({a, b}, out), "the result has 35 numbers, must have 36");
}

TYPED_TEST(Kernels, BadAttention) {
  using T = typename TypeParam::Number;
  const std::vector<T> queries(2 * 6), keys(3 * 6), values(3 * 8);
  const Index index = {0, 1, 2, 0}, beyond = {0, 1, 2, 3};
  const AttentionShape good{.heads = 2, .key_width = 3, .value_width = 4, .k = 2};
  const auto attend = [&](const AttentionShape& shape, const AttentionInput<T>& input) {
    return attention<T>(this->device(), shape, input);
  };
  const AttentionInput<T> input{queries, keys, values, index};
  EXPECT_TRUE(attend(good, input));
  const auto with = [&](auto change) {
    AttentionShape shape = good;
    change(shape);
    return shape;
  };
  expect_error(attend(with([](auto& s) { s.heads = 65; }), input), "heads is 65, must be 1 … 64");
  expect_error(attend(with([](auto& s) { s.key_width = 0; }), input), "key_width is 0, must be 1 … 1024");
  expect_error(attend(with([](auto& s) { s.value_width = 2147483647; }), input), "value_width is 2147483647");
  expect_error(attend(with([](auto& s) { s.k = 65; }), input), "k is 65, must be 1 … 64");
  expect_error(attend(with([](auto& s) { s.scale = std::nan(""); }), input), "scale is nan");
  expect_error(attend(with([](auto& s) { s.k = 3; }), input), "index: 4 numbers are not rows of 3");
  expect_error(attend(with([](auto& s) { s.key_width = 4; }), input), "keys: 18 numbers are not rows of 8");
  expect_error(attend(with([](auto& s) { s.value_width = 3; }), input),
               "values has 24 numbers, must have 18");
  expect_error(attend(good, {queries, keys, values, beyond}), "index: entry 3 is 3, of 3 rows");
  expect_error(attend(good, {keys, keys, values, index}), "queries has 18 numbers, must have 12");
}

TEST(KernelsTest, DoubleIsForTheCpu) {
  const auto device = Vulkan::device();
  if (!device) GTEST_SKIP() << "no Vulkan here";
  const auto refused = [](const auto& result) {
    ASSERT_FALSE(result);
    EXPECT_EQ(result.error().code, ErrorCode::unsupported) << result.error().message;
  };
  refused(make_knn<double>(*device, {}));
  refused(make_cg_product<double>(*device, {}));
  refused(make_attention<double>(*device, {}));
}

// Nothing is written outside the result, and threads do not change it.
TEST(KernelsTest, OperationsKeepToTheirMemory) {
  using graph::Rows;
  using test::OpTensor;
  Random random(5);
  graph::BatchLayout layout;
  layout.cloud_offset = {0, 50};
  layout.key_offset = {0, 77};
  const auto real = [&](Rows rows, int per_row, int width) {
    OpTensor tensor{rows, per_row, width, false, {}, {}};
    tensor.values = numbers<double>(random, layout.rows(rows) * per_row * width);
    return tensor;
  };
  const OpTensor index{Rows::key, 5, 1, true, {}, random_index(random, 77 * 5, 50)};
  const auto check = [&](const ops::Op& op, const std::vector<OpTensor>& inputs, OpTensor out) {
    out.values.clear();
    ThreadPool one(1), three(3);
    const auto first = test::run_op<float>(op, layout, inputs, {out}, one).front().values;
    EXPECT_EQ(test::run_op<float>(op, layout, inputs, {out}, three).front().values, first);
    test::run_op<double>(op, layout, inputs, {out}, three);
    if (!test::vulkan()) return;
    const auto device = test::run_op_vulkan(op, layout, inputs, {out});
    ASSERT_EQ(device.size(), 1u);
    for (std::size_t i = 0; i < first.size(); ++i) ASSERT_NEAR(device[0].values[i], first[i], 1e-5);
  };
  for (const bool shared : {false, true})
    check(ops::CgProduct{{1, 1}, {2, 0}, {2, 1}, 3, shared},
          {real(Rows::point, 1, 27), real(Rows::key, 5, shared ? 5 : 15), index}, real(Rows::key, 5, 45));
  check(ops::CgProduct{{1, 0}, {1, 0}, {1, 0}, 3, false}, {real(Rows::key, 1, 9), real(Rows::key, 1, 9)},
        real(Rows::key, 1, 9));
  check(ops::NeighbourAttention{0.5},
        {real(Rows::key, 3, 5), real(Rows::point, 3, 5), real(Rows::point, 3, 7), index},
        real(Rows::key, 3, 7));
}

}  // namespace
}  // namespace bitr
