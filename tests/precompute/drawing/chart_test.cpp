#include "precompute/drawing/chart.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <limits>
#include <regex>
#include <string>
#include <vector>

namespace exmat::precompute {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

struct Box {
  double x = 0, y = 0, width = 0;
};

// Those of the bars, which are told from the legend's by their height.
std::vector<Box> boxes(const std::string& svg) {
  const std::regex pattern(R"re(<rect x="([\d.]+)" y="([\d.]+)" width="([\d.]+)" height="34")re");
  std::vector<Box> found;
  for (std::sregex_iterator i(svg.begin(), svg.end(), pattern); i != std::sregex_iterator(); ++i)
    found.push_back({std::stod((*i)[1]), std::stod((*i)[2]), std::stod((*i)[3])});
  return found;
}

double mark_at(const std::string& svg) {
  const std::regex pattern(R"re(<path d="M([\d.]+) [\d.]+V[\d.]+" stroke="currentColor" stroke-width="2.5")re");
  std::smatch match;
  EXPECT_TRUE(std::regex_search(svg, match, pattern));
  return std::stod(match[1]);
}

StackedBars some_bars() {
  return {"title", "x [%]", {{"a", ""}, {"b", "not known"}, {"c<d", ""}}, {{"mean", {1, 0, 3}, 2, "total"}}};
}

TEST(StackedBars, StandSideBySideToScale) {
  const std::string svg = stacked_svg(some_bars());
  const auto found = boxes(svg);
  ASSERT_EQ(found.size(), 2U) << "nothing of what is not known";
  EXPECT_NEAR(found[1].width, 3 * found[0].width, 0.02);
  EXPECT_NEAR(found[1].x, found[0].x + found[0].width, 0.02);
  EXPECT_EQ(found[0].y, found[1].y);
  EXPECT_NEAR(mark_at(svg), found[0].x + 2 * found[0].width, 0.06);
  EXPECT_THAT(svg, HasSubstr("not known"));
  EXPECT_THAT(svg, HasSubstr("c&lt;d"));
  EXPECT_THAT(svg, Not(HasSubstr("c<d")));
}

TEST(StackedBars, LeaveOutWhatIsNotFinite) {
  StackedBars bars = some_bars();
  bars.bars[0].values[2] = std::numeric_limits<double>::infinity();
  EXPECT_EQ(boxes(stacked_svg(bars)).size(), 1U);
  bars.bars[0].values.assign(3, 0);
  bars.bars[0].mark = 0;
  const std::string empty = stacked_svg(bars);
  EXPECT_TRUE(boxes(empty).empty());
  EXPECT_THAT(empty, Not(HasSubstr("nan")));
  EXPECT_THAT(empty, Not(HasSubstr("inf")));
}

}  // namespace
}  // namespace exmat::precompute
