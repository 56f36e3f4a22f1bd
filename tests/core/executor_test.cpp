// What every executor does with a caller's numbers, and the CPU's guards.
#include "graph/executor.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "cpu/executor.hpp"

namespace bitr::graph {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

std::string message(const std::function<void()>& body) {
  try {
    body();
    return "none";
  } catch (const Failure& failure) {
    EXPECT_EQ(failure.error().code, ErrorCode::internal);
    return failure.what();
  }
}

// Memory as a device has it: rows of three numbers, four apart; and a list of indices.
class Padded : public Executor {
 public:
  Padded() {
    graph_.add({.name = "rows", .width = 3, .fiber = {}});
    graph_.add({.name = "list", .kind = ElementKind::index, .fiber = {}});
  }
  void prepare(const BatchLayout&) override {}
  void run() override {}
  void replace(Graph graph) override { graph_ = std::move(graph); }
  const Graph& graph() const override { return graph_; }
  const BatchLayout& layout() const override { return layout_; }
  std::size_t workspace_bytes() const override { return sizeof numbers; }
  const std::vector<double>& node_milliseconds() const override { return times_; }
  const std::vector<double>& node_starts() const override { return times_; }
  bool guards_hold() const override { return true; }
  TensorView input(TensorId id) const override {
    using Number = TensorView::Number;
    if (id == 0) return {const_cast<float*>(numbers), Number::f32, 2, 3, 4};
    return {const_cast<std::uint32_t*>(indices), Number::u32, 5, 1, 1};
  }
  TensorView output(TensorId id) const override { return input(id); }

  float numbers[8] = {9, 9, 9, 9, 9, 9, 9, 9};
  std::uint32_t indices[5] = {};

 private:
  Graph graph_;
  BatchLayout layout_;
  std::vector<double> times_;
};

TEST(Executor, PadsRowsWithZerosAndReadsThemTight) {
  Padded executor;
  executor.write(0, std::vector<double>{1, 2, 3, 4, 5, 6.5});
  EXPECT_THAT(executor.numbers, ElementsAre(1, 2, 3, 0, 4, 5, 6.5, 0));
  EXPECT_THAT(executor.read<double>(0), ElementsAre(1, 2, 3, 4, 5, 6.5));
  std::vector<float> room(6);
  executor.read(0, std::span(room));
  EXPECT_THAT(room, ElementsAre(1, 2, 3, 4, 5, 6.5));
  executor.write(1, std::vector<std::uint32_t>{7, 6, 5, 4, 3});
  EXPECT_THAT(executor.read<std::uint32_t>(1), ElementsAre(7, 6, 5, 4, 3));
}

TEST(Executor, RefusesOtherSizesAndOtherKinds) {
  Padded executor;
  EXPECT_THAT(message([&] { executor.write(0, std::vector<float>(7)); }),
              HasSubstr("rows: 7 numbers for a tensor of 6"));
  std::vector<double> room(5);
  EXPECT_THAT(message([&] { executor.read(0, std::span(room)); }), HasSubstr("5 numbers for a tensor of 6"));
  EXPECT_THAT(message([&] { executor.write(1, std::vector<float>(5)); }), HasSubstr("list: "));
  EXPECT_THAT(message([&] { executor.write(0, std::vector<std::uint32_t>(6)); }), HasSubstr("rows: "));
  EXPECT_THAT(message([&] { executor.read<double>(1); }), HasSubstr("list: "));
  EXPECT_THAT(executor.numbers, testing::Each(9)) << "written although refused";
}

// out = a + b over the points of two clouds.
template <class T>
class CpuExecutor : public testing::Test {
 protected:
  static Graph sum() {
    Graph graph;
    const TensorId a = graph.add({.name = "a", .width = 2, .fiber = {}}),
                   b = graph.add({.name = "b", .width = 2, .fiber = {}}),
                   out = graph.add_output(Output::result, {.name = "out", .width = 2, .fiber = {}});
    graph.append("sum", ops::Sum{}, {a, b}, {out});
    return graph;
  }
  static BatchLayout layout(std::uint32_t points) {
    const std::uint32_t sizes[] = {points, 1};
    return {sizes, 0};
  }
  ThreadPool pool_{2};
};
using Types = testing::Types<float, double>;
TYPED_TEST_SUITE(CpuExecutor, Types);

TYPED_TEST(CpuExecutor, RunsBatchAfterBatch) {
  cpu::Executor<TypeParam> executor(this->sum(), this->pool_);
  for (const std::uint32_t points : {2u, 1u, 400u}) {
    executor.prepare(this->layout(points));
    const std::size_t count = 2 * (points + 1);
    std::vector<double> a(count), b(count), expected(count);
    for (std::size_t i = 0; i < count; ++i) {
      a[i] = 0.5 * static_cast<double>(i);
      b[i] = 1 - 0.25 * static_cast<double>(i);
      expected[i] = a[i] + b[i];
    }
    executor.write(0, a);
    executor.write(1, b);
    executor.run();
    EXPECT_EQ(executor.template read<double>(Output::result), expected);
  }
  EXPECT_EQ(executor.counters().dispatches, 0u);
  EXPECT_EQ(executor.node_starts().size(), 1u);
  EXPECT_GE(executor.node_milliseconds()[0], 0);
}

TYPED_TEST(CpuExecutor, GuardsTellWhoWritesBehindATensor) {
  cpu::Executor<TypeParam> executor(this->sum(), this->pool_, {.guard_bytes = 64});
  executor.prepare(this->layout(3));
  EXPECT_TRUE(std::isnan(executor.template read<double>(2)[0])) << "unwritten, and not NaN";
  executor.write(0, std::vector<double>(8, 1.0));
  executor.write(1, std::vector<double>(8, 2.0));
  executor.run();
  EXPECT_TRUE(executor.guards_hold());
  for (const TensorId id : {0, 1, 2}) {
    TypeParam& behind = executor.data(id)[8];
    const TypeParam guard = behind;
    behind = 0;
    EXPECT_FALSE(executor.guards_hold()) << id;
    behind = guard;
    EXPECT_TRUE(executor.guards_hold()) << id;
  }
}

}  // namespace
}  // namespace bitr::graph
