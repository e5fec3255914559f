#pragma once

#include <string>
#include <vector>

namespace exmat::precompute {

struct PlotPoint {
  double x = 0, y = 0;
  std::string label;  ///< shown where the pointer is
};

/// Points of one colour and shape, joined or not; of no colour: those of the page's text.
struct PlotSeries {
  std::string name;  ///< in the legend; empty: not there
  std::vector<PlotPoint> points;
  int colour = -1;  ///< index into the palette, which repeats
  int shape = -1;   ///< likewise; negative: no marks
  bool joined = false, dashed = false;
};

struct Plot {
  std::string title, x_label, y_label;
  bool log_x = false, log_y = true;
  std::vector<PlotSeries> series;
};

/// An <svg> element. Points that are not finite, or not positive on a logarithmic axis, are left out.
std::string plot_svg(const Plot& plot);

/// One kind of part, of one colour in all bars.
struct StackedPart {
  std::string name;
  std::string remark;  ///< why the part is in no bar
};

/// Values of all parts, and a mark on the same axis.
struct StackedBar {
  std::string name;
  std::vector<double> values;  ///< >= 0, in the order of the parts
  double mark = 0;
  std::string mark_name;
};

struct StackedBars {
  std::string title, x_label;
  std::vector<StackedPart> parts;
  std::vector<StackedBar> bars;
};

/// An <svg> element: horizontal bars, their parts side by side, and a legend. Values that are not finite are left out.
std::string stacked_svg(const StackedBars& picture);

}  // namespace exmat::precompute
