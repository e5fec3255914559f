#pragma once

#include <Eigen/Geometry>
#include <functional>
#include <string>
#include <vector>

#include "common/mesh/tet_mesh.h"
#include "tests/support/posed_bodies.h"

namespace exmat::test {

/// Differences between two bodies of one kind.
struct Proportions {
  double length = 1;  ///< length of limbs
  double girth = 1;
};

struct BodyPose {
  std::string name;
  Pose pose;
};

/// A body by its signed distance, and poses that are known everywhere in it.
struct PosableBody {
  std::string name;
  std::function<double(const Eigen::Vector3d&)> distance;  ///< negative inside
  Eigen::AlignedBox3d bounds;
  double cell = 0;              ///< edge of a grid that shows it coarsely
  std::vector<BodyPose> poses;  ///< the same for all proportions
};

/// A figure and a four-legged animal, skinned upon the bones of a skeleton; thin letters C and D; a bar with an arm.
/// `strength` multiplies the angles of the poses.
PosableBody figure_body(const Proportions& proportions, double strength);
PosableBody animal_body(const Proportions& proportions, double strength);
PosableBody letter_c_body(const Proportions& proportions, double strength);
PosableBody letter_d_body(const Proportions& proportions, double strength);
PosableBody armed_bar_body(const Proportions& proportions, double strength);

enum class TetKind { kCubes, kBodyCentred };  ///< six tets a cube; a body-centred lattice

/// Meshing of a posed body into tets: by a grid that knows nothing of the body at rest.
struct Meshing {
  TetKind kind = TetKind::kCubes;
  double cell = 0;         ///< edge of the grid's cells
  bool staircase = false;  ///< the surface follows the cells instead of the body
  double noise = 0;        ///< noise of the surface, over `cell`
  int holes = 0;           ///< bites of two cells out of the surface
  std::uint32_t seed = 0;  ///< shifts the grid, shakes the surface, places the holes
};

/// A mesh of the body in a pose. Largest component alone; every tet of positive volume.
TetMesh meshed(const PosableBody& body, const Pose& pose, const Meshing& meshing);

}  // namespace exmat::test
