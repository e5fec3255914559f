#pragma once

#include <Eigen/Core>
#include <array>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "precompute/fem/quadratic_tets.h"

namespace exmat::benchmarks {

constexpr double kYoungsModulus = 1e6, kDensity = 1000;  // [Pa], [kg/m^3]
constexpr Eigen::Index kModes = 6;

/// A shape that is clamped where x = 0, by a grid of cells along, across and through.
struct Shape {
  std::string name;
  std::vector<std::array<int, 3>> cells;  ///< from coarse to fine
  std::array<double, 3> lengths;
  std::function<bool(const Eigen::Vector3d&)> holds;       ///< whether a tet about this point belongs to it
  std::function<Eigen::Vector3d(Eigen::Vector3d)> placed;  ///< where a vertex of the grid is
};

/// Bars, plates, an L and most of a ring.
const std::vector<Shape>& all_shapes();

/// Vertices of the grid that no tet has are left out; those inside are moved at random where the mesh is to be
/// unstructured.
TetMesh mesh_of(const Shape& shape, const std::array<int, 3>& cells, bool unstructured = false);
FlagVector clamp_of(const Shape& shape, const std::array<int, 3>& cells);

/// Elements as `bundle` makes them: of smoothed ones beta is fitted, where the mesh is not too large for it.
TetMaterials material_of(const TetMesh& mesh, double poisson_ratio, Formulation formulation, const FlagVector& clamp);
precompute::QuadraticTets quadratic_of(const TetMesh& mesh, double poisson_ratio, const FlagVector& clamp);

/// Work of loads of the body on what they bend, stretch and twist, and the lowest frequencies.
struct Response {
  Eigen::Vector4d work;         ///< by a unit weight along x, y, z, and a turn about the x axis through the middle
  Eigen::VectorXd frequencies;  ///< [kModes] [rad/s]
};
Response response_of(const precompute::ElasticSystem& system, const VertexArray& nodes);

/// Each figure over that of the reference: 1 is right.
Response over(const Response& response, const Response& reference);

/// A table of the page, which begins there with its head.
struct Table {
  std::string head, rows;
};
Table shape_table();
/// None where there is no CalculiX (ccx).
std::optional<Table> calculix_table();
Table load_table();
/// None where there is no mesher.
std::optional<Table> cage_table();

}  // namespace exmat::benchmarks
