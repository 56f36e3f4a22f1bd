// knn against a double loop: the same neighbours in the same order, ties included.
#include <algorithm>
#include <cmath>

#include "core/random.hpp"
#include "support/op_run.hpp"
#include "support/plain_knn.hpp"
#include "support/vulkan.hpp"

namespace bitr {
namespace {

using graph::BatchLayout;
using graph::Rows;
using test::OpTensor;

std::vector<double> random_points(Random& random, std::size_t count, int dim, int lattice) {
  std::vector<double> points;
  for (std::size_t i = 0; i < count * dim; ++i) {
    // Multiples of 2⁻²⁰ are exact in float; a coarse lattice makes most distances tie.
    const double x = lattice < 0 ? std::pow(random.uniform(-1, 1), 5) : random.uniform(-1, 1);
    points.push_back(lattice > 0 ? std::round(x * lattice) / 8 : std::round(x * 0x1p20) * 0x1p-20);
  }
  return points;
}

class KnnCase {
 public:
  KnnCase(std::vector<std::uint32_t> sizes, std::uint32_t keys) : layout_(sizes, keys) {}

  // Compares every `step`-th query.
  template <class T>
  void check(const ops::Knn& op, Rows query_rows, Rows reference_rows, int lattice, std::size_t step = 1) {
    Random random(layout_.rows(Rows::point) + op.k);
    OpTensor references{reference_rows, 1, op.dim, false, {}, {}}, queries = references;
    references.values = random_points(random, layout_.rows(reference_rows), op.dim, lattice);
    queries.rows = query_rows;
    queries.values = op.exclude_self ? references.values
                                     : random_points(random, layout_.rows(query_rows), op.dim, lattice);
    const OpTensor index{query_rows, op.k, 1, true, {}, {}};
    const auto found = test::run_op<T>(op, layout_, {queries, references}, {index}, two_).front().indices;
    EXPECT_EQ(test::run_op<T>(op, layout_, {queries, references}, {index}, one_).front().indices, found);
    EXPECT_EQ(test::run_op<T>(op, layout_, {queries, references}, {index}, three_).front().indices, found);
    if constexpr (std::is_same_v<T, float>) {
      if (test::vulkan()) {
        EXPECT_EQ(test::run_op_vulkan(op, layout_, {queries, references}, {index}).front().indices, found);
      }
    }
    const std::vector<T> q(queries.values.begin(), queries.values.end()),
        r(references.values.begin(), references.values.end());
    for (std::uint32_t s = 0; s < layout_.segments(query_rows); ++s)
      for (std::size_t row = layout_.begin(query_rows, s); row < layout_.begin(query_rows, s + 1);
           row += step) {
        const auto nearest =
            test::nearest_rows(&q[row * op.dim], r.data(), layout_.begin(reference_rows, s),
                               layout_.begin(reference_rows, s + 1), op.exclude_self ? row : std::size_t(-1),
                               op.k * op.dilation, op.dim);
        std::vector<std::uint32_t> expected;
        for (int n = op.dilation - 1; n < op.k * op.dilation; n += op.dilation)
          expected.push_back(nearest[n]);
        const std::vector<std::uint32_t> got(found.begin() + row * op.k, found.begin() + (row + 1) * op.k);
        ASSERT_EQ(got, expected) << "query " << row << ", lattice " << lattice << ", k " << op.k << ", dim "
                                 << op.dim;
      }
  }
  void check_both(const ops::Knn& op, Rows queries, Rows references, int lattice, std::size_t step = 1) {
    check<float>(op, queries, references, lattice, step);
    check<double>(op, queries, references, lattice, step);
  }
  // Either search, asked for, is what is found without asking.
  void check_searches(ops::Knn op, int lattice) {
    Random random(layout_.rows(Rows::point) + op.k);
    OpTensor points{Rows::point, 1, 3, false, random_points(random, layout_.rows(Rows::point), 3, lattice),
                    {}};
    const OpTensor index{Rows::point, op.k, 1, true, {}, {}};
    const auto by = [&](NeighborSearch search, auto run) {
      op.search = search;
      return run().front().indices;
    };
    const auto on_cpu = [&]<class T>(T) {
      return [&] { return test::run_op<T>(op, layout_, {points, points}, {index}, two_); };
    };
    const auto on_vulkan = [&] { return test::run_op_vulkan(op, layout_, {points, points}, {index}); };
    const auto expected = by(NeighborSearch::automatic, on_cpu(0.0F));
    for (const NeighborSearch search : {NeighborSearch::brute_force, NeighborSearch::tree}) {
      SCOPED_TRACE(search == NeighborSearch::tree ? "tree" : "brute force");
      EXPECT_EQ(by(search, on_cpu(0.0F)), expected) << "lattice " << lattice << ", k " << op.k;
      EXPECT_EQ(by(search, on_cpu(0.0)), by(NeighborSearch::automatic, on_cpu(0.0)));
      if (test::vulkan()) {
        EXPECT_EQ(by(search, on_vulkan), expected) << "lattice " << lattice << ", k " << op.k;
      }
    }
  }

 private:
  BatchLayout layout_;
  ThreadPool one_{1}, two_{2}, three_{3};
};

// 0: generic points; 1: 27 places; 4: a 9³ lattice, where nearly every neighbour ties; −1: denser inside.
constexpr int lattices[] = {0, 1, 4};

TEST(Knn, SmallCloudsOfEverySize) {
  for (const int k : {1, 2, 7, 8, 24, 64})
    for (const int lattice : lattices) {
      const auto n = static_cast<std::uint32_t>(k);
      KnnCase({n + 1, n + 2, n + 9, 65}, 5).check_both({.k = k}, Rows::point, Rows::point, lattice);
    }
}

// Sizes around every limit between brute force and the tree that has been in use, 200 and 3000.
TEST(Knn, CloudsAroundTheTree) {
  for (const int lattice : lattices) {
    KnnCase({199, 200, 201, 202, 255, 1024}, 5).check_both({.k = 24}, Rows::point, Rows::point, lattice);
    KnnCase({2999, 3000, 3001, 25}, 5).check_both({.k = 24}, Rows::point, Rows::point, lattice, 7);
    KnnCase({3001, 501}, 5).check_both({.k = 64}, Rows::point, Rows::point, lattice, 11);
    KnnCase({700, 501}, 5).check_both({.k = 1}, Rows::point, Rows::point, lattice, 3);
  }
}

TEST(Knn, QueriesThatAreNotAmongTheReferences) {
  for (const int lattice : lattices) {
    KnnCase({24, 25, 300, 4000}, 32)
        .check_both({.k = 24, .exclude_self = false}, Rows::key, Rows::point, lattice);
    KnnCase({30, 4000}, 200).check_both({.k = 5, .exclude_self = false}, Rows::key, Rows::point, lattice);
  }
}

TEST(Knn, PairsOfKeyPoints) {
  for (const std::uint32_t keys : {25u, 32u, 33u, 300u})
    for (const int lattice : lattices)
      KnnCase({40, 50, 60, 70}, keys)
          .check_both({.k = 24, .dim = 6, .exclude_self = true}, Rows::pair_key, Rows::pair_key, lattice);
}

// On both sides of what the CPU (200) and Vulkan (4096) take without being asked.
TEST(Knn, EverySearchFindsTheSame) {
  for (const int lattice : lattices) {
    for (const std::uint32_t k : {1u, 24u, 64u})
      KnnCase({k + 1, k + 2, k + 9, 97}, 5).check_searches({.k = static_cast<int>(k)}, lattice);
    KnnCase({199, 200, 201, 255, 1025}, 5).check_searches({.k = 24}, lattice);
    KnnCase({97, 333}, 5).check_searches({.k = 24, .dilation = 4}, lattice);
    KnnCase({4095, 25}, 5).check_searches({.k = 24}, lattice);
    KnnCase({25, 4096, 300, 4097}, 5).check_searches({.k = 24}, lattice);
  }
}

TEST(Knn, SeventyThousandPoints) {
  for (const int lattice : {0, 16}) {
    KnnCase large({70001, 25}, 5);
    large.check_both({.k = 24}, Rows::point, Rows::point, lattice, 1733);
  }
}

TEST(Knn, EverySoMany) {
  for (const int lattice : {0, 1, 4, -1}) {
    KnnCase({97, 150, 333, 191, 192, 193, 1024, 260}, 8)
        .check_both({.k = 24, .dilation = 4, .dim = 3, .exclude_self = true}, Rows::point, Rows::point,
                    lattice);
    KnnCase({97, 150}, 8)
        .check_both({.k = 5, .dilation = 3, .dim = 3, .exclude_self = false}, Rows::key, Rows::point,
                    lattice);
    // By the tree.
    KnnCase({5000, 97}, 8)
        .check_both({.k = 24, .dilation = 4, .dim = 3, .exclude_self = true}, Rows::point, Rows::point,
                    lattice, 101);
  }
  // In parts.
  KnnCase({40000, 200}, 8)
      .check_both({.k = 24, .dilation = 4, .dim = 3, .exclude_self = false}, Rows::key, Rows::point, 0);
  KnnCase({40000, 200}, 8)
      .check_both({.k = 8, .dilation = 3, .dim = 3, .exclude_self = false}, Rows::key, Rows::point, 0);
}

TEST(Knn, VulkanSaysHowManyItFinds) {
  if (!test::vulkan()) GTEST_SKIP() << "no Vulkan device";
  const BatchLayout layout(std::vector<std::uint32_t>{200, 200}, 4);
  const vk::KernelContext site{*test::vulkan(), {{}, {}}, {{}}, layout};
  try {
    vk::kernel_for(site, ops::Knn{.k = 40, .dilation = 4});
    ADD_FAILURE();
  } catch (const Failure& failure) {
    EXPECT_EQ(failure.error().code, ErrorCode::unsupported);
    EXPECT_NE(failure.error().message.find("160"), std::string::npos) << failure.error().message;
    EXPECT_NE(failure.error().message.find("128"), std::string::npos) << failure.error().message;
  }
}

// Points of any kind, on the CPU, by the tree: also where squares are denormal, and many on one spot, which
// bounds the search around the others by no more than the distance to it.
template <class T>
void check_tree(double scale, int power, std::size_t on_one_spot) {
  SCOPED_TRACE(testing::Message() << sizeof(T) << " bytes, scale " << scale << ", power " << power);
  const BatchLayout layout(std::vector<std::uint32_t>{600, 600}, 4);
  Random random(5);
  OpTensor points{Rows::point, 1, 3, false, {}, {}};
  for (std::size_t i = 0; i < 3 * 1200; ++i) {
    const double x = scale * std::pow(random.uniform(-1, 1), power);
    points.values.push_back(i >= 3 && i < 3 * on_one_spot ? points.values[i % 3]
                                                          : static_cast<double>(static_cast<T>(x)));
  }
  const std::vector<T> rows(points.values.begin(), points.values.end());
  ThreadPool pool(2);
  for (const int k : {1, 24, 90}) {
    const ops::Knn op{.k = k, .search = NeighborSearch::tree};
    const OpTensor out{Rows::point, k, 1, true, {}, {}};
    const auto found = test::run_op<T>(op, layout, {points, points}, {out}, pool).front().indices;
    for (std::size_t row = 0; row < 1200; ++row) {
      const std::size_t begin = row / 600 * 600;
      const auto expected = test::nearest_rows(&rows[3 * row], rows.data(), begin, begin + 600, row, k, 3);
      ASSERT_EQ(std::vector<std::uint32_t>(found.begin() + row * k, found.begin() + (row + 1) * k), expected)
          << "query " << row << ", k " << k;
    }
  }
}

TEST(Knn, AnyScaleByTheTree) {
  for (const double scale : {1e-20, 1e-18, 1e-15, 1., 1e18})
    for (const int power : {1, 9})
      for (const std::size_t on_one_spot : {0, 300}) {
        check_tree<float>(scale, power, on_one_spot);
        check_tree<double>(scale, power, on_one_spot);
      }
}

// All points on one spot but one.
TEST(Knn, PointsOnOneSpot) {
  OpTensor points{Rows::point, 1, 3, false, std::vector<double>(3 * 1000, 0.25), {}};
  points.values[3 * 500] = 7;
  const BatchLayout layout(std::vector<std::uint32_t>{500, 500}, 4);
  ThreadPool pool(2);
  const OpTensor out{Rows::point, 3, 1, true, {}, {}};
  const auto index =
      test::run_op<float>(ops::Knn{.k = 3}, layout, {points, points}, {out}, pool).front().indices;
  EXPECT_EQ(std::vector<std::uint32_t>(index.begin(), index.begin() + 6),
            (std::vector<std::uint32_t>{1, 2, 3, 0, 2, 3}));
  EXPECT_EQ(std::vector<std::uint32_t>(index.begin() + 1500, index.begin() + 1506),
            (std::vector<std::uint32_t>{501, 502, 503, 502, 503, 504}));
  if (!test::vulkan()) GTEST_SKIP() << "no Vulkan device";
  for (const ops::Knn& op : {ops::Knn{.k = 3}, ops::Knn{.k = 24, .dilation = 4}}) {
    const OpTensor found{Rows::point, op.k, 1, true, {}, {}};
    EXPECT_EQ(test::run_op_vulkan(op, layout, {points, points}, {found}).front().indices,
              test::run_op<float>(op, layout, {points, points}, {found}, pool).front().indices);
  }
}

}  // namespace
}  // namespace bitr
