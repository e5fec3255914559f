#include "precompute/study/drawing/svg.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <initializer_list>
#include <map>
#include <utility>

#include "common/core/markup.h"
#include "precompute/study/drawing/svg_parts.h"

namespace exmat::precompute {
namespace {

// Of a plot [px].
constexpr double kWidth = 860, kHeight = 380, kLeft = 66, kRight = 300, kTop = 30, kBottom = 46;

constexpr double kFewDecades = 0.7;  // on an axis: evenly spaced numbers say more than 1, 2, 5

// From values to pixels along one axis.
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

  static std::vector<double> linear_ticks(double low, double high) {
    const double rough = (high - low) / 5, decade = std::pow(10, std::floor(std::log10(rough)));
    double step = decade;
    for (const double factor : {1.0, 2.0, 5.0, 10.0})
      if (factor * decade <= rough * 1.5) step = factor * decade;
    std::vector<double> ticks;
    for (double at = std::ceil(low / step) * step; at <= high; at += step)
      ticks.push_back(std::abs(at) < 1e-9 * step ? 0 : at);
    return ticks;
  }

  bool logarithmic_;
  double first_, last_, low_ = 0, high_ = 1;
};

std::string mark(int shape, double x, double y, const char* colour) {
  const auto filled = [&](const char* path) {
    return fmt::format("<path transform=\"translate({:.1f} {:.1f})\" d=\"{}\" fill=\"{}\">", x, y, path, colour);
  };
  switch (shape % 6) {
    case 0:
      return fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"4.5\" fill=\"{}\">", x, y, colour);
    case 1:
      return filled("M-4-4h8v8h-8z");
    case 2:
      return filled("M0-5.5L5 4h-10z");
    case 3:
      return filled("M0-6L6 0 0 6-6 0z");
    case 4:
      return filled("M0 5.5L5-4h-10z");
    default:
      return filled("M-5-1.5h3.5v-3.5h3v3.5h3.5v3h-3.5v3.5h-3v-3.5h-3.5z");
  }
}

const char* closing(int shape) { return shape % 6 == 0 ? "</circle>" : "</path>"; }

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
    if (series.shape < 0) continue;
    marks += mark(series.shape, px, py, colour_of(series.colour));
    marks += fmt::format("<title>{}</title>{}\n", escaped(point.label), closing(series.shape));
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
    if (series.shape >= 0) svg += mark(series.shape, x, y, colour_of(series.colour)) + closing(series.shape) + "\n";
    svg += text_at(x + 16, y + 4, "start", series.name);
    y += 17;
  }
  return svg;
}

// Of a picture of bodies [px].
constexpr double kPanel = 300, kMargin = 10;
constexpr int kShades = 8, kSlices = 24;

// Rows right, up, towards the viewer, who looks down at a corner.
Eigen::Matrix3d view(const Eigen::Vector3d& up) {
  const Eigen::Vector3d side = up.unitOrthogonal();
  const Eigen::Vector3d towards = (Eigen::AngleAxisd(0.6, up) * side + 0.45 * up).normalized();
  Eigen::Matrix3d rows;
  rows.row(0) = up.cross(towards).normalized();
  rows.row(2) = towards;
  rows.row(1) = towards.cross(rows.row(0).transpose());
  return rows;
}

// Numbers of path data, with a blank only where it is needed.
std::string path_numbers(std::initializer_list<int> numbers) {
  std::string text;
  for (const int number : numbers) {
    if (!text.empty() && number >= 0) text += ' ';
    text += std::to_string(number);
  }
  return text;
}

// Triangles of one look, each from the first corner of the one before.
struct Triangles {
  std::string path = "M0 0";
  Eigen::Vector2i last = Eigen::Vector2i::Zero();

  void add(const Eigen::Vector2i& p, const Eigen::Vector2i& q, const Eigen::Vector2i& r) {
    const Eigen::Vector2i move = p - last, first = q - p, second = r - q;
    path +=
        "m" + path_numbers({move[0], move[1]}) + "l" + path_numbers({first[0], first[1], second[0], second[1]}) + "z";
    last = p;
  }
};

// The faces turned to the viewer, in slices from the farthest on, those of a shade together: many fewer bytes than one
// by one, and hidden by their neighbours alike.
std::string panel(const TriangleArray& surface, const VertexArray& points, double depth_low, double depth_high) {
  std::map<std::pair<int, int>, Triangles> looks;
  for (const auto& triangle : surface.rowwise()) {
    const Eigen::Vector3d a = points.row(triangle[0]), b = points.row(triangle[1]), c = points.row(triangle[2]);
    const Eigen::Vector3d normal = (b - a).cross(c - a);
    if (normal[2] <= 0) continue;
    const double slope = normal[2] / normal.norm(), depth = (a + b + c)[2] / 3;
    const double share = (depth - depth_low) / std::max(depth_high - depth_low, 1e-300);
    const auto pixel = [](const Eigen::Vector3d& x) { return Eigen::Vector2i(std::lround(x[0]), std::lround(-x[1])); };
    const Eigen::Vector2i p = pixel(a), q = pixel(b), r = pixel(c);
    if ((q - p)[0] * (r - q)[1] == (q - p)[1] * (r - q)[0]) continue;  // nothing to be seen
    looks[{static_cast<int>(std::clamp(share, 0.0, 0.999) * kSlices),
           static_cast<int>(std::min(slope, 0.999) * kShades)}]
        .add(p, q, r);
  }
  std::string svg;
  for (const auto& [look, triangles] : looks)
    svg += fmt::format("<path class=\"s{}\" d=\"{}\"/>\n", look.second, triangles.path);
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

std::string bodies_svg(const TriangleArray& surface, const VertexArray& first, const VertexArray& second,
                       const Eigen::Vector3d& up, const std::string& id) {
  const Eigen::Matrix3d turn = view(up);
  VertexArray seen(first.rows() + second.rows(), 3);
  seen << first * turn.transpose(), second * turn.transpose();
  const Eigen::RowVector3d low = seen.colwise().minCoeff(), high = seen.colwise().maxCoeff();
  const double size = std::max({high[0] - low[0], high[1] - low[1], 1e-300}), scale = (kPanel - 2 * kMargin) / size;
  const Eigen::RowVector3d middle = 0.5 * (low + high);
  seen = scale * (seen.rowwise() - middle);
  const double depth = 0.5 * scale * (high[2] - low[2]), height = scale * (high[1] - low[1]) + 2 * kMargin;
  const auto group = [&](const char* kind, const VertexArray& points, double x) {
    return fmt::format("<g id=\"{0}{1}\" class=\"{1}\" transform=\"translate({2:.0f} {3:.0f})\">\n{4}</g>\n", id, kind,
                       x, 0.5 * height, panel(surface, points, -depth, depth));
  };
  return fmt::format("<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0:.0f} {1:.0f}\" width=\"{0:.0f}\">\n",
                     3 * kPanel, height) +
         group("full", seen.topRows(first.rows()), 0.5 * kPanel) +
         group("reduced", seen.bottomRows(second.rows()), 1.5 * kPanel) +
         fmt::format(
             "<use href=\"#{0}full\" x=\"{1:.0f}\"/><use href=\"#{0}reduced\" x=\"{2:.0f}\" "
             "opacity=\"0.55\"/>\n</svg>\n",
             id, 2 * kPanel, kPanel);
}

}  // namespace exmat::precompute
