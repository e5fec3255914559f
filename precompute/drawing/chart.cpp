#include "precompute/drawing/chart.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>

#include "common/core/markup.h"
#include "precompute/drawing/table.h"

namespace exmat::precompute {
namespace {

/// Readable on light and dark pages.
constexpr std::array<const char*, 8> kPalette{"#4477aa", "#ee6677", "#228833", "#c0a020",
                                              "#33aacc", "#aa3377", "#888888", "#ee8833"};

/// One of the palette, which repeats; negative: the colour of the page's text.
const char* colour_of(int colour) {
  return colour < 0 ? "currentColor" : kPalette[static_cast<std::size_t>(colour) % kPalette.size()];
}

/// A <text> element; `anchor` is "start", "middle" or "end", `more` further attributes.
std::string text_at(double x, double y, const char* anchor, const std::string& text, const char* more = "") {
  return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\"{}>{}</text>\n", x, y, anchor, more,
                     escaped(text));
}

/// About five even numbers from `low` to `high`.
std::vector<double> linear_ticks(double low, double high) {
  const double rough = (high - low) / 5, decade = std::pow(10, std::floor(std::log10(rough)));
  double step = decade;
  for (const double factor : {1.0, 2.0, 5.0, 10.0})
    if (factor * decade <= rough * 1.5) step = factor * decade;
  std::vector<double> ticks;
  for (double at = std::ceil(low / step) * step; at <= high; at += step)
    ticks.push_back(std::abs(at) < 1e-9 * step ? 0 : at);
  return ticks;
}

// Sizes of a plot [px].
constexpr double kWidth = 860, kHeight = 380, kLeft = 66, kRight = 300, kTop = 30, kBottom = 46;

constexpr double kFewDecades = 0.7;  // an axis of fewer has evenly spaced numbers, not 1, 2, 5

/// Maps values to pixels along one axis.
class Axis {
 public:
  Axis(std::vector<double> values, bool logarithmic, double first, double last)
      : logarithmic_(logarithmic), first_(first), last_(last) {
    if (values.empty()) values = {1, 10};
    const auto [least, most] = std::ranges::minmax(values);
    low_ = mapped(least);
    high_ = mapped(most);
    const double margin = std::max(0.06 * (high_ - low_), logarithmic ? 0.1 : 1e-3 * std::abs(high_) + 1e-12);
    low_ -= margin;
    high_ += margin;
  }

  bool shows(double value) const { return std::isfinite(value) && (!logarithmic_ || value > 0); }
  double pixel(double value) const { return first_ + (mapped(value) - low_) / (high_ - low_) * (last_ - first_); }

  std::vector<double> ticks() const {
    if (!logarithmic_) return linear_ticks(low_, high_);
    return high_ - low_ < kFewDecades ? linear_ticks(std::pow(10, low_), std::pow(10, high_)) : log_ticks();
  }

 private:
  double mapped(double value) const { return logarithmic_ ? std::log10(value) : value; }

  std::vector<double> log_ticks() const {
    const std::vector<double> digits = high_ - low_ < 2.5 ? std::vector<double>{1, 2, 5} : std::vector<double>{1};
    std::vector<double> ticks;
    for (int decade = static_cast<int>(std::floor(low_)); decade <= static_cast<int>(std::ceil(high_)); ++decade)
      for (const double digit : digits)
        if (const double at = decade + std::log10(digit); at >= low_ && at <= high_)
          ticks.push_back(std::pow(10, decade) * digit);
    return ticks;
  }

  bool logarithmic_;
  double first_, last_, low_ = 0, high_ = 1;
};

/// An element that shows `title` where the pointer is.
std::string mark(int shape, double x, double y, const char* colour, const std::string& title) {
  constexpr std::array<const char*, 6> kShapes{"M-4.5 0a4.5 4.5 0 1 0 9 0a4.5 4.5 0 1 0-9 0",
                                               "M-4-4h8v8h-8z",
                                               "M0-5.5L5 4h-10z",
                                               "M0-6L6 0 0 6-6 0z",
                                               "M0 5.5L5-4h-10z",
                                               "M-5-1.5h3.5v-3.5h3v3.5h3.5v3h-3.5v3.5h-3v-3.5h-3.5z"};
  return fmt::format("<path transform=\"translate({:.1f} {:.1f})\" d=\"{}\" fill=\"{}\"><title>{}</title></path>\n", x,
                     y, kShapes[static_cast<std::size_t>(shape) % kShapes.size()], colour, escaped(title));
}

std::string axes(const Plot& plot, const Axis& x, const Axis& y) {
  const double right = kWidth - kRight, bottom = kHeight - kBottom;
  std::string svg = text_at(kLeft, 18, "start", plot.title, " font-weight=\"600\"");
  for (const double tick : x.ticks()) {
    const double at = x.pixel(tick);
    svg += fmt::format("<path d=\"M{0:.1f} {1}V{2}\" class=\"grid\"/>\n", at, kTop, bottom);
    svg += text_at(at, bottom + 16, "middle", fmt::format("{:g}", tick));
  }
  for (const double tick : y.ticks()) {
    const double at = y.pixel(tick);
    svg += fmt::format("<path d=\"M{1} {0:.1f}H{2}\" class=\"grid\"/>\n", at, kLeft, right);
    svg += text_at(kLeft - 6, at + 4, "end", fmt::format("{:g}", tick));
  }
  svg +=
      fmt::format("<path d=\"M{0} {1}V{2}H{3}\" fill=\"none\" stroke=\"currentColor\"/>\n", kLeft, kTop, bottom, right);
  svg += text_at(0.5 * (kLeft + right), kHeight - 8, "middle", plot.x_label);
  const double middle = 0.5 * (kTop + bottom);
  svg += text_at(14, middle, "middle", plot.y_label, fmt::format(" transform=\"rotate(-90 14 {})\"", middle).c_str());
  return svg;
}

std::string drawn(const PlotSeries& series, const Axis& x, const Axis& y) {
  std::string line, marks;
  for (const PlotPoint& point : series.points) {
    if (!x.shows(point.x) || !y.shows(point.y)) continue;
    const double px = x.pixel(point.x), py = y.pixel(point.y);
    line += fmt::format("{}{:.1f} {:.1f}", line.empty() ? "M" : "L", px, py);
    if (series.shape >= 0) marks += mark(series.shape, px, py, colour_of(series.colour), point.label);
  }
  if (!series.joined || line.empty()) return marks;
  return fmt::format("<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.5\"{}/>\n", line,
                     colour_of(series.colour), series.dashed ? " stroke-dasharray=\"5 4\"" : "") +
         marks;
}

std::string legend(const Plot& plot) {
  std::string svg;
  double y = kTop + 6;
  for (const PlotSeries& series : plot.series) {
    if (series.name.empty() || y > kHeight - 8) continue;
    const double x = kWidth - kRight + 18;
    if (series.joined)
      svg += fmt::format("<path d=\"M{} {}h18\" stroke=\"{}\" stroke-width=\"1.5\"{}/>\n", x - 9, y,
                         colour_of(series.colour), series.dashed ? " stroke-dasharray=\"5 4\"" : "");
    if (series.shape >= 0) svg += mark(series.shape, x, y, colour_of(series.colour), series.name);
    svg += text_at(x + 16, y + 4, "start", series.name);
    y += 17;
  }
  return svg;
}

// Sizes of stacked bars [px].
constexpr double kBarLeft = 80, kBarRight = 30, kBarTop = 52, kBar = 34, kBarStep = 72, kLegendRow = 20;
constexpr double kLegendText = 26;  // from the swatch
constexpr double kWidestText = 42;  // fits into a part that is wider

double drawn_length(double value) { return std::isfinite(value) ? std::max(value, 0.0) : 0; }

double longest_bar(const StackedBars& picture) {
  double longest = 0;
  for (const StackedBar& bar : picture.bars) {
    double sum = 0;
    for (const double value : bar.values) sum += drawn_length(value);
    longest = std::max({longest, sum, drawn_length(bar.mark)});
  }
  return longest > 0 ? longest : 1;
}

std::string bar_axis(const StackedBars& picture, double bottom, double longest, double scale) {
  std::string svg;
  for (const double tick : linear_ticks(0, longest)) {
    const double x = kBarLeft + scale * tick;
    svg +=
        fmt::format("<path d=\"M{0:.1f} {1:.1f}V{2:.1f}\" class=\"grid\" stroke=\"#8886\"/>\n", x, kBarTop - 8, bottom);
    svg += text_at(x, bottom + 16, "middle", fmt::format("{:g}", tick));
  }
  return svg + text_at(0.5 * (kBarLeft + kWidth - kBarRight), bottom + 34, "middle", picture.x_label);
}

std::string bar_svg(const StackedBars& picture, const StackedBar& bar, double y, double scale) {
  std::string svg = text_at(kBarLeft - 10, y + 0.5 * kBar + 4, "end", bar.name);
  double x = kBarLeft;
  for (std::size_t i = 0; i < bar.values.size(); ++i) {
    const double width = scale * drawn_length(bar.values[i]);
    if (width == 0) continue;
    svg += fmt::format(
        "<rect x=\"{:.2f}\" y=\"{:.1f}\" width=\"{:.2f}\" height=\"{}\" fill=\"{}\"><title>{} {}</title></rect>\n", x,
        y, width, kBar, colour_of(static_cast<int>(i)), escaped(picture.parts[i].name), short_number(bar.values[i]));
    if (width > kWidestText)
      svg += text_at(x + 0.5 * width, y + 0.5 * kBar + 4, "middle", short_number(bar.values[i]),
                     " style=\"fill:#fff\" font-weight=\"600\"");
    x += width;
  }
  if (!std::isfinite(bar.mark)) return svg;
  const double mark = kBarLeft + scale * drawn_length(bar.mark);
  const bool on_the_right = mark > 0.75 * kWidth;
  svg += fmt::format("<path d=\"M{0:.1f} {1:.1f}V{2:.1f}\" stroke=\"currentColor\" stroke-width=\"2.5\"/>\n", mark,
                     y - 7, y + kBar + 7);
  return svg + text_at(mark + (on_the_right ? -6 : 6), y - 8, on_the_right ? "end" : "start",
                       bar.mark_name + " " + short_number(bar.mark), " font-weight=\"600\"");
}

std::string bar_legend(const StackedBars& picture, double y) {
  std::string svg;
  for (std::size_t i = 0; i < picture.parts.size(); ++i, y += kLegendRow) {
    const StackedPart& part = picture.parts[i];
    const char* colour = colour_of(static_cast<int>(i));
    svg += fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"12\" height=\"12\" fill=\"{}\" stroke=\"{}\"/>\n",
                       kBarLeft, y - 10, part.remark.empty() ? colour : "none", colour);
    svg +=
        text_at(kBarLeft + kLegendText, y, "start", part.remark.empty() ? part.name : part.name + ": " + part.remark);
  }
  return svg;
}

}  // namespace

std::string plot_svg(const Plot& plot) {
  std::vector<double> xs, ys;
  for (const PlotSeries& series : plot.series)
    for (const PlotPoint& point : series.points) {
      const bool shown = std::isfinite(point.x) && std::isfinite(point.y) && (!plot.log_x || point.x > 0) &&
                         (!plot.log_y || point.y > 0);
      if (!shown) continue;
      xs.push_back(point.x);
      ys.push_back(point.y);
    }
  const Axis x(xs, plot.log_x, kLeft, kWidth - kRight), y(ys, plot.log_y, kHeight - kBottom, kTop);
  std::string svg = fmt::format("<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0} {1}\" width=\"{0}\">\n",
                                kWidth, kHeight);
  svg += axes(plot, x, y);
  for (const PlotSeries& series : plot.series) svg += drawn(series, x, y);
  return svg + legend(plot) + "</svg>\n";
}

std::string stacked_svg(const StackedBars& picture) {
  const double longest = longest_bar(picture), scale = (kWidth - kBarLeft - kBarRight) / longest;
  const double bottom = kBarTop + kBarStep * static_cast<double>(picture.bars.size()) - (kBarStep - kBar) + 12;
  const double height = bottom + 56 + kLegendRow * static_cast<double>(picture.parts.size());
  std::string svg = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0} {1:.0f}\" width=\"{0}\" "
      "font-family=\"system-ui, sans-serif\" font-size=\"12\" fill=\"currentColor\">\n",
      kWidth, height);
  svg += text_at(kBarLeft, 18, "start", picture.title, " font-weight=\"600\"");
  svg += bar_axis(picture, bottom, longest, scale);
  double y = kBarTop;
  for (const StackedBar& bar : picture.bars) {
    svg += bar_svg(picture, bar, y, scale);
    y += kBarStep;
  }
  return svg + bar_legend(picture, bottom + 62) + "</svg>\n";
}

}  // namespace exmat::precompute
