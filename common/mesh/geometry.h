#pragma once

#include <Eigen/Core>

#include "common/mesh/tet_mesh.h"

namespace exmat {

/// n_t signed volumes [m^3].
Eigen::VectorXd tet_volumes(const TetMesh& mesh);

/// [4 x 3] gradients of the four linear shape functions of a tet with the given [4 x 3] vertex positions [1/m].
Eigen::Matrix<double, 4, 3> shape_gradients(const Eigen::Matrix<double, 4, 3>& positions);

/// [4 x 3] vertex positions of one tet.
Eigen::Matrix<double, 4, 3> tet_positions(const TetMesh& mesh, Eigen::Index tet);

/// Barycentric coordinates of a point in a tet with the given [4 x 3] corners, of any sign; they add up to 1.
Eigen::Vector4d barycentric(const Eigen::Matrix<double, 4, 3>& corners, const Eigen::Vector3d& point);

/// Volume-weighted centroid [m].
Eigen::Vector3d centroid(const TetMesh& mesh);

/// Length of the diagonal of the axis-aligned bounding box [m].
double bounding_box_diagonal(const VertexArray& vertices);

/// Its longest edge [m].
double longest_box_edge(const VertexArray& vertices);

/// Origin of places near `place`, in whole metres: 0 where single precision moves them by less than 1e-5
/// of `size` [m] from there, else a place beside them.
Eigen::Vector3d origin_near(const Eigen::Vector3d& place, double size);
/// Origin of vertices that are drawn.
Eigen::Vector3d origin_near(const VertexArray& vertices);

/// [n_t] shares of the tets in an elastic energy of a region: the mean of the window over a tet whose vertices are all
/// inside, 0 of others. `inside` [n] flags the region's vertices, `window` [n] are the values there.
Eigen::VectorXd region_tet_shares(const TetMesh& mesh, const FlagVector& inside, const Eigen::VectorXd& window);

/// n_f x 3 outward-oriented boundary triangles, in the order of their tets.
TriangleArray surface_triangles(const TetArray& tets);

}  // namespace exmat
