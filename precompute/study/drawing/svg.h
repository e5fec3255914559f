#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "common/core/arrays.h"

namespace exmat::precompute {

struct PlotPoint {
  double x = 0, y = 0;
  std::string label;  ///< shown where the pointer is
};

/// Points of one colour and shape, joined or not; of no colour: those of the page's text.
struct PlotSeries {
  std::string name;  ///< in the legend; empty: not there
  std::vector<PlotPoint> points;
  int colour = -1;  ///< of the palette, which begins anew
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

/// Two poses of one surface [n x 3], [n_f x 3]: the first, the second, and both on one another. `id` is unique on the
/// page. Below 60 kB for some 4,000 triangles.
std::string bodies_svg(const TriangleArray& surface, const VertexArray& first, const VertexArray& second,
                       const Eigen::Vector3d& up, const std::string& id);

}  // namespace exmat::precompute
