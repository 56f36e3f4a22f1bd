#include "svg/svg.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "core/random.hpp"

namespace bitr::svg {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;
using testing::Pointwise;

TEST(Axis, GoesFromEndToEnd) {
  const Axis x = Axis::linear(-2, 6, 100, 500), y = Axis::logarithmic(0.01, 100, 300, 100);
  EXPECT_DOUBLE_EQ(x.at(-2), 100);
  EXPECT_DOUBLE_EQ(x.at(0), 200);
  EXPECT_DOUBLE_EQ(x.at(6), 500);
  EXPECT_DOUBLE_EQ(y.at(0.01), 300);
  EXPECT_DOUBLE_EQ(y.at(1), 200);
  EXPECT_DOUBLE_EQ(y.at(100), 100);
}

TEST(Axis, HasRoundTicks) {
  EXPECT_THAT(Axis::linear(0, 180, 0, 1).ticks(), ElementsAre(0, 20, 40, 60, 80, 100, 120, 140, 160, 180));
  EXPECT_THAT(Axis::linear(0, 4, 0, 1).ticks(), ElementsAre(0, 1, 2, 3, 4));
  EXPECT_THAT(Axis::linear(0, 1, 0, 1).ticks(),
              Pointwise(testing::DoubleEq(), {0.0, 0.2, 0.4, 0.6, 0.8, 1.0}));
  EXPECT_THAT(Axis::logarithmic(1, 20, 0, 1).ticks(),
              Pointwise(testing::DoubleEq(), {1.0, 2.0, 5.0, 10.0, 20.0}));
  EXPECT_FALSE(std::signbit(Axis::linear(0, 1, 0, 1).ticks()[0])) << "reads as −0";
}

TEST(Axis, HasAFewTicksWhateverItsEnds) {
  Random random(1);
  for (int i = 0; i < 1000; ++i) {
    const double low = random.uniform(-1, 1) * std::pow(10, random.uniform(-6, 6)),
                 high = low + std::pow(10, random.uniform(-3, 6));
    const auto ticks = Axis::linear(low, high, 0, 1).ticks();
    EXPECT_GE(ticks.size(), 4u) << low << " " << high;
    EXPECT_LE(ticks.size(), 11u) << low << " " << high;
    for (const double tick : ticks) {
      EXPECT_GE(tick, low - 1e-6 * (high - low));
      EXPECT_LE(tick, high + 1e-6 * (high - low));
    }
  }
}

TEST(Text, CannotBecomeAnythingElse) {
  const std::string nasty = "</text><script>\"'&\n";
  for (const std::string& made : {text_at(1, 2, nasty, "start"), rectangle(0, 0, 1, 1, "red", nasty),
                                  circle(0, 0, 1, "red", nasty), escaped(nasty)}) {
    EXPECT_THAT(made, Not(HasSubstr("<script")));
    EXPECT_THAT(made, HasSubstr("&lt;script>&quot;'&amp; "));
  }
}

}  // namespace
}  // namespace bitr::svg
