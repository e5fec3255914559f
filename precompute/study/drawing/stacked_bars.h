#pragma once

#include <string>
#include <vector>

namespace exmat::precompute {

/// One kind of part, of one colour in all bars.
struct StackedPart {
  std::string name;
  std::string remark;  ///< in the place of a value in the legend; the part is then in no bar
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

/// An <svg> element: horizontal bars, their parts side by side, and a legend with the values of each. Values that are
/// not finite are left out.
std::string stacked_svg(const StackedBars& picture);

}  // namespace exmat::precompute
