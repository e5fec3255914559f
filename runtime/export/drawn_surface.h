#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <filesystem>
#include <memory>
#include <string>

#include "common/core/arrays.h"

namespace exmat::runtime {

struct DrawnSkin;
struct SurfaceLook;

/// Drawn surface of a body: v vertices, f triangles, r modes. A body with reduced coordinates q stands at
/// vertices + modes q in its own frame, the origin of which is at `origin` in the world at rest. Where modes are not
/// what moves it, the principal components of its motion take their place.
struct DrawnSurface {
  std::string name;                                          ///< name of the asset
  std::string source;                                        ///< dataset of the bundle that it is made from
  VertexArray vertices;                                      ///< v x 3, at rest, from the origin [m]
  TriangleArray triangles;                                   ///< f x 3
  Eigen::SparseMatrix<double, Eigen::RowMajor> of_vertices;  ///< v x n, by the n vertices of the object
  RowMatrix modes;                                           ///< 3v x r [kg^(-1/2)], row 3k + axis
  const char* mode_name = "mode";                            ///< what a mode is called
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();          ///< centre of mass of a free body, else origin_near() [m]
  std::shared_ptr<const SurfaceLook> look;                   ///< look of the file that it came from, or none
  std::shared_ptr<const DrawnSkin> skin;                     ///< with the bones of the file that it came from, or none
  bool free = false;                                         ///< it turns about its origin, else about 0

  Eigen::Index vertex_count() const { return vertices.rows(); }
  Eigen::Index mode_count() const { return modes.cols(); }
};

/// The render mesh of a bundle or, with `mesh` or where it has none, the surface of its tet mesh. Throws InputError.
DrawnSurface read_drawn_surface(const std::filesystem::path& bundle, bool mesh);

}  // namespace exmat::runtime
