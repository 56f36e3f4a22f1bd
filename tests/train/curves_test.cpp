#include "train/curves.hpp"

#include <gmock/gmock.h>

#include <limits>

namespace bitr::train {
namespace {

using testing::HasSubstr;
using testing::Not;

std::size_t count(const std::string& text, const std::string& word) {
  std::size_t n = 0;
  for (std::size_t at = text.find(word); at != std::string::npos; at = text.find(word, at + 1)) ++n;
  return n;
}

TEST(Curves, ShowEveryLineWithItsLastValue) {
  History history;
  for (std::size_t step = 10; step <= 1000; step += 10)
    history.losses.push_back({step, 10.0 / static_cast<double>(step), 0.25, -0.01});
  for (const std::size_t step : {500, 1000}) {
    ValidationResult validation;
    validation.step = step;
    for (const char* name : {"aircraft <s=0.3>", "vessels"}) {
      ValidationGroup group{name, {}};
      group.errors.rotation.median = 12.5;
      group.errors.translation.median = 0.125;
      validation.groups.push_back(group);
    }
    history.validations.push_back(validation);
  }
  const std::string svg = curves_svg(history, "a run");
  EXPECT_EQ(count(svg, "<polyline"), 6u);
  EXPECT_EQ(count(svg, "<circle"), 8u) << "validations are few";
  for (const char* text : {"a run", "aircraft &lt;s=0.3>", ">12.5<", ">0.125<", ">0.01<", ">1000<", "step"})
    EXPECT_THAT(svg, HasSubstr(text));
  EXPECT_THAT(svg, Not(HasSubstr("nan")));
  EXPECT_THAT(svg, Not(HasSubstr("inf")));
}

TEST(Curves, StandLittleAndOddData) {
  EXPECT_EQ(count(curves_svg({}, "empty"), "nothing yet"), 3u);
  History history;
  history.losses.push_back({5, 1, 1, 0});
  EXPECT_THAT(curves_svg(history, ""), Not(HasSubstr("nan")));
  history.losses.push_back({6, std::numeric_limits<double>::quiet_NaN(), 0, 0});
  history.losses.push_back({7, std::numeric_limits<double>::infinity(), -1, 0});
  const std::string svg = curves_svg(history, "");
  EXPECT_THAT(svg, Not(HasSubstr("nan")));
  EXPECT_THAT(svg, Not(HasSubstr("inf")));
}

TEST(Curves, StayAPictureHoweverLongTheRun) {
  History history;
  for (std::size_t step = 10; step <= 1'000'000; step += 10) history.losses.push_back({step, 1, 1, 0});
  EXPECT_LT(curves_svg(history, "").size(), 40'000u);
}

}  // namespace
}  // namespace bitr::train
