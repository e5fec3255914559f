#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <memory>
#include <string>

#include "common/core/arrays.h"

namespace exmat::runtime {

struct SurfaceLook;

/// Drawn surface of a reduced body: v vertices, f triangles, r modes. A body with reduced coordinates q stands at
/// vertices + modes q in its own frame, the origin of which is at `origin` in the world at rest.
struct DrawnSurface {
  std::string name;                                  ///< name of the asset
  std::string source;                                ///< dataset of the bundle that it is made from
  VertexArray vertices;                              ///< v x 3, at rest, from the origin [m]
  TriangleArray triangles;                           ///< f x 3
  RowMatrix modes;                                   ///< 3v x r [kg^(-1/2)], row 3k + axis
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();  ///< centre of mass of a free body, else origin_near() [m]
  std::shared_ptr<const SurfaceLook> look;           ///< look of the file that it came from, or none
  bool free = false;                                 ///< it turns about its origin, else about 0

  Eigen::Index vertex_count() const { return vertices.rows(); }
  Eigen::Index mode_count() const { return modes.cols(); }
};

/// The render mesh of a bundle or, with `mesh` or where it has none, the surface of its tet mesh. Throws InputError.
DrawnSurface read_drawn_surface(const std::filesystem::path& bundle, bool mesh);

}  // namespace exmat::runtime
