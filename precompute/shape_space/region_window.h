#pragma once

#include <Eigen/Core>

#include "common/core/arrays.h"
#include "common/mesh/tet_mesh.h"

namespace exmat::precompute {

/// Width of a region's band, over the mean distance of the region's points from its border.
inline constexpr double kBandShare = 0.5;

/// Window of a region: 0 at its border, 1 beyond a band along it, a smooth step of the distance between. The border is
/// the region's vertices beside others and the faces that they span. The band's width is a length that the region's
/// shape gives, not a number of layers: docs/method.md, "Regions".
struct RegionWindow {
  Eigen::VectorXd values;  ///< n, 0 to 1; 0 outside of the region
  /// [n] integrals of the window's slope, each vertex with its share [m^2]: where the band is, and how much of it. All
  /// zero where there is no border. Where all of the region is border there is no room for a band: the window is the
  /// region's indicator, and these are the lumped volumes of the border [m^3].
  Eigen::VectorXd band;
};

/// `inside` [n] flags the region's vertices.
RegionWindow region_window(const TetMesh& mesh, const FlagVector& inside);

/// [n] volumes, a quarter of each tet with each of its vertices [m^3].
Eigen::VectorXd lumped_volumes(const TetMesh& mesh);

}  // namespace exmat::precompute
