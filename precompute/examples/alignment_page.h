#pragma once

#include <string>
#include <vector>

#include "common/mesh/tet_mesh.h"
#include "precompute/examples/alignment_verdict.h"

namespace exmat::precompute {

/// A pose as the object has it and as it was given, both in the object's frame.
struct ReportedPose {
  AlignmentOutcome outcome;
  TetMesh transferred;  ///< the object
  TetMesh given;        ///< the example, as large as the object
};

/// Distance of the middle of each triangle of a surface from another surface [n_f].
Eigen::VectorXd surface_distances(const TetMesh& from, const TetMesh& to);

/// A page in HTML that needs nothing beside it: for each pose the verdict, what to change, and pictures from two sides
/// of the object at rest, of the pose as the object has it and as it was given, and of both coloured by their distance
/// from one another.
std::string alignment_page(const std::string& title, const TetMesh& rest, const std::vector<ReportedPose>& poses);

}  // namespace exmat::precompute
