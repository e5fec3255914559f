#include "precompute/study/drawing/stacked_bars.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

#include "common/core/markup.h"
#include "precompute/study/drawing/svg_parts.h"

namespace exmat::precompute {
namespace {

// Of the picture [px].
constexpr double kWidth = 860, kLeft = 80, kRight = 30, kTop = 52, kBar = 34, kStep = 72, kRow = 20;
constexpr double kNameColumn = 26, kFirstColumn = 150, kColumn = 100;  // of the legend, from kLeft
constexpr double kTallest = 42;                                        // of text in a part that is wide enough for it

double drawn(double value) { return std::isfinite(value) ? std::max(value, 0.0) : 0; }

std::string number(double value) {
  if (!std::isfinite(value)) return "-";
  return value != 0 && value < 0.01 ? fmt::format("{:.1e}", value)
                                    : fmt::format("{:.{}f}", value,
                                                  value < 1    ? 3
                                                  : value < 10 ? 2
                                                               : 1);
}

// Even numbers, four to ten of them.
double tick_step(double longest) {
  const double decade = std::pow(10, std::floor(std::log10(longest / 4)));
  for (const double factor : {5.0, 2.0})
    if (factor * decade <= longest / 4) return factor * decade;
  return decade;
}

double longest_bar(const StackedBars& picture) {
  double longest = 0;
  for (const StackedBar& bar : picture.bars) {
    double sum = 0;
    for (const double value : bar.values) sum += drawn(value);
    longest = std::max({longest, sum, drawn(bar.mark)});
  }
  return longest > 0 ? longest : 1;
}

std::string swatch(double x, double y, std::size_t part, bool hollow) {
  const char* colour = colour_of(static_cast<int>(part));
  return fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"12\" height=\"12\" fill=\"{}\" stroke=\"{}\"/>\n", x, y,
                     hollow ? "none" : colour, colour);
}

std::string axis(const StackedBars& picture, double bottom, double longest, double scale) {
  std::string svg;
  const double step = tick_step(longest);
  for (int i = 0; i * step <= longest * (1 + 1e-9); ++i) {
    const double x = kLeft + scale * i * step;
    svg += fmt::format("<path d=\"M{0:.1f} {1:.1f}V{2:.1f}\" class=\"grid\" stroke=\"#8886\"/>\n", x, kTop - 8, bottom);
    svg += text_at(x, bottom + 16, "middle", fmt::format("{:g}", i * step));
  }
  return svg + text_at(0.5 * (kLeft + kWidth - kRight), bottom + 34, "middle", picture.x_label);
}

std::string bar_svg(const StackedBars& picture, const StackedBar& bar, double y, double scale) {
  std::string svg = text_at(kLeft - 10, y + 0.5 * kBar + 4, "end", bar.name);
  double x = kLeft;
  for (std::size_t i = 0; i < bar.values.size(); ++i) {
    const double width = scale * drawn(bar.values[i]);
    if (width == 0) continue;
    svg += fmt::format(
        "<rect x=\"{:.2f}\" y=\"{:.1f}\" width=\"{:.2f}\" height=\"{}\" fill=\"{}\"><title>{} {}</title></rect>\n", x,
        y, width, kBar, colour_of(static_cast<int>(i)), escaped(picture.parts[i].name), number(bar.values[i]));
    if (width > kTallest)
      svg += text_at(x + 0.5 * width, y + 0.5 * kBar + 4, "middle", number(bar.values[i]),
                     " style=\"fill:#fff\" font-weight=\"600\"");
    x += width;
  }
  if (!std::isfinite(bar.mark)) return svg;
  const double mark = kLeft + scale * drawn(bar.mark);
  const bool on_the_right = mark > 0.75 * kWidth;
  svg += fmt::format("<path d=\"M{0:.1f} {1:.1f}V{2:.1f}\" stroke=\"currentColor\" stroke-width=\"2.5\"/>\n", mark,
                     y - 7, y + kBar + 7);
  return svg + text_at(mark + (on_the_right ? -6 : 6), y - 8, on_the_right ? "end" : "start",
                       bar.mark_name + " " + number(bar.mark), " font-weight=\"600\"");
}

std::string legend(const StackedBars& picture, double top) {
  std::string svg;
  double x = kLeft + kFirstColumn;
  for (const StackedBar& bar : picture.bars) svg += text_at(x += kColumn, top, "end", bar.name, " font-weight=\"600\"");
  for (std::size_t i = 0; i < picture.parts.size(); ++i) {
    const StackedPart& part = picture.parts[i];
    const double y = top + kRow * static_cast<double>(i + 1);
    svg += swatch(kLeft, y - 10, i, !part.remark.empty());
    svg += text_at(kLeft + kNameColumn, y, "start", part.name);
    x = kLeft + kFirstColumn;
    if (!part.remark.empty()) svg += text_at(x + kColumn, y, "end", part.remark, " opacity=\"0.7\"");
    for (const StackedBar& bar : picture.bars)
      if (part.remark.empty()) svg += text_at(x += kColumn, y, "end", number(bar.values[i]));
  }
  return svg;
}

}  // namespace

std::string stacked_svg(const StackedBars& picture) {
  const double longest = longest_bar(picture), scale = (kWidth - kLeft - kRight) / longest;
  const double bottom = kTop + kStep * static_cast<double>(picture.bars.size()) - (kStep - kBar) + 12;
  const double height = bottom + 56 + kRow * static_cast<double>(picture.parts.size() + 1);
  std::string svg = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0} {1:.0f}\" width=\"{0}\" "
      "font-family=\"system-ui, sans-serif\" font-size=\"12\" fill=\"currentColor\">\n",
      kWidth, height);
  svg += text_at(kLeft, 18, "start", picture.title, " font-weight=\"600\"");
  svg += axis(picture, bottom, longest, scale);
  double y = kTop;
  for (const StackedBar& bar : picture.bars) {
    svg += bar_svg(picture, bar, y, scale);
    y += kStep;
  }
  return svg + legend(picture, bottom + 62) + "</svg>\n";
}

}  // namespace exmat::precompute
