#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "precompute/alignment/rigid_fit.h"
#include "precompute/examples/alignment_verdict.h"

namespace exmat::precompute {

/// A rotation of the rest example, and how many others lay it over the object as well.
struct RestTurn {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  std::int64_t competing = 0;
};

/// Placing of a rest example on the object by its surface: gap and turn. docs/alignment.md, "The rest example".
class RestPlacing {
 public:
  /// Both at centroid 0 and volume 1, as they stand.
  RestPlacing(const LaplaceBasis& rest, const TetArray& rest_tets, const LaplaceBasis& object,
              const TetArray& object_tets)
      : fitter_(body_surface(rest, rest_tets), body_surface(object, object_tets)) {}

  double gap(const Eigen::Matrix3d& rotation) const { return fitter_.at(rotation).gap; }

  /// The rotation that lays it on the object, the smallest of those that fit as well; none where none fits much better
  /// than it stands.
  RestTurn turn();

  /// Fills in the residual, and judges it: by its size, by the rest example's mirror image, by what of either surface
  /// the other lacks.
  void judge(const RestTurn& turn, AlignmentOutcome& outcome);

 private:
  RigidFitter fitter_;
  std::optional<RestTurn> turn_;
};

}  // namespace exmat::precompute
