#include "precompute/examples/example_scale.h"

#include <array>
#include <cmath>
#include <fmt/format.h>

namespace exmat::precompute {
namespace {

// Ratios of units of length that files are written in: powers of ten, inches, feet and yards among metres and each
// other. Their reciprocals count as well.
constexpr std::array kUnits{2.54, 1 / 0.3048, 10.0, 12.0, 25.4, 1 / 0.0254, 100.0, 1000.0};
// A ratio that is as near as this to one of them is one: bodies change little of their size when they are posed.
constexpr double kUnitTolerance = 0.05;
// Up to this factor another size is the pose's own; no ratio of units is below.
constexpr double kMostOwnSize = 2;
// An own change of length that is worth a warning: 12 % of the volume.
constexpr double kOwnSizeWarning = 0.04;
// A rest example of another size than the object's is another body, or the object in another unit.
constexpr double kRestSizeWarning = 0.25;

// Ratios beyond 1 + tolerance and its reciprocal.
bool differs(double ratio, double tolerance) { return std::abs(std::log(ratio)) > std::log1p(tolerance); }

// The ratio of units that a ratio of lengths is nearly; 0 where it is none.
double unit_near(double ratio) {
  for (const double larger : kUnits)
    for (const double unit : {larger, 1 / larger})
      if (!differs(ratio / unit, kUnitTolerance)) return unit;
  return 0;
}

std::string volume_text(double size) {
  return fmt::format("its volume is {:.3g} times the rest example's ({:.3g} times in length)", size * size * size,
                     size);
}

}  // namespace

PoseScale scale_of_pose(double pose_volume, double rest_volume, bool same_mesh) {
  PoseScale scale;
  const double ratio = std::cbrt(pose_volume / rest_volume);
  scale.size = ratio;
  const bool own = !differs(ratio, kMostOwnSize - 1);
  if (same_mesh && !own) {
    scale.objection = volume_text(ratio) + ", whose own mesh it is: " +
                      (unit_near(ratio) > 0 ? "a pose keeps the rest example's unit of length; export both in the same"
                                            : "a pose keeps about its body's volume; mend what squeezes or swells it, "
                                              "and export both in the same unit of length");
    return scale;
  }
  if (!own) {
    const double unit = unit_near(ratio);
    scale.unit = unit > 0 ? unit : ratio;
    scale.size = ratio / scale.unit;
    if (unit > 0)
      scale.note = fmt::format(
          "its file is {:.5g} times as large as the rest example's, taken as another unit of "
          "length: divided by {:.5g}",
          ratio, unit);
    else
      scale.warning = fmt::format(
          "its file is {:.5g} times as large as the rest example's, which no units of length explain: "
          "brought to the rest example's volume, and what it changes of that is lost; export both in the "
          "same unit",
          ratio);
  }
  if (differs(scale.size, kOwnSizeWarning))
    scale.warning = volume_text(scale.size) + ": taken as part of the pose; if it is not meant, scale its mesh";
  return scale;
}

std::string remark_on_rest_scale(double rest_volume, double object_volume) {
  const double ratio = std::cbrt(rest_volume / object_volume);
  if (!differs(ratio, kRestSizeWarning) || unit_near(ratio) > 0) return {};
  return fmt::format(
      "it is {:.5g} times as large as the object, which no units of length explain: its poses are "
      "divided by that; is it the object's shape?",
      ratio);
}

}  // namespace exmat::precompute
