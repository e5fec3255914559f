// Loads on small places, as of a hand, a contact (pressed) and its friction (sheared): how deep their dents are.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <fmt/format.h>
#include <map>

#include "common/mesh/geometry.h"
#include "precompute/solvers/semidefinite_solver.h"
#include "tests/benchmark/stiffness/shapes.h"

namespace exmat::benchmarks {
namespace {

const Shape kBlock{"block",
                   {{4, 4, 4}, {8, 8, 8}, {16, 16, 16}},
                   {1, 1, 1},
                   [](const Eigen::Vector3d&) { return true; },
                   [](Eigen::Vector3d x) { return x; }};

// A node's place on a grid of half the edges of the finest mesh.
std::array<int, 3> place_of(const Eigen::RowVector3d& x) {
  const auto at = [](double value) { return static_cast<int>(std::lround(32 * value)); };
  return {at(x[0]), at(x[1]), at(x[2])};
}

// [3n x 2] unit loads on the middle of the face that is opposite to the clamp: along its normal and along y. On a
// square of that width, as a pressure; on the vertex in the middle where the width is 0.
Eigen::MatrixXd loads_on(const VertexArray& nodes, const TetMesh& mesh, bool quadratic, double width) {
  std::map<std::array<int, 3>, Eigen::Index> at;
  for (Eigen::Index v = 0; v < nodes.rows(); ++v) at[place_of(nodes.row(v))] = v;
  Eigen::VectorXd shares = Eigen::VectorXd::Zero(nodes.rows());
  if (width == 0) shares[at.at(place_of({1, 0.5, 0.5}))] = 1;
  const TriangleArray surface = surface_triangles(mesh.tets);
  for (const auto& triangle : surface.rowwise()) {
    const Eigen::Matrix3d corners = mesh.vertices(triangle, Eigen::all);
    const Eigen::RowVector3d centre = corners.colwise().mean();
    if (centre[0] < 1 - 1e-9 || std::abs(centre[1] - 0.5) > width / 2 || std::abs(centre[2] - 0.5) > width / 2)
      continue;
    // Triangles have one area. The functions of quadratic corners have no mean, those of edges a third each.
    for (int k = 0; k < 3; ++k)
      shares[quadratic ? at.at(place_of((corners.row(k) + corners.row((k + 1) % 3)) / 2)) : triangle[k]] += 1;
  }
  shares /= shares.sum();
  Eigen::MatrixXd loads = Eigen::MatrixXd::Zero(nodes.size(), 2);
  for (Eigen::Index v = 0; v < nodes.rows(); ++v) loads(3 * v, 0) = loads(3 * v + 1, 1) = shares[v];
  return loads;
}

// Work of each of the two.
Eigen::Array2d dents(const precompute::ElasticSystem& system, const Eigen::MatrixXd& loads) {
  const precompute::SemidefiniteSolver solver(system.stiffness, system.mass * system.null_space, "block", system.rigid);
  const Eigen::MatrixXd free_loads = system.restrict(loads);
  return free_loads.cwiseProduct(solver.solve(free_loads)).colwise().sum().transpose();
}

Eigen::Array2d quadratic_dents(const std::array<int, 3>& cells, double poisson_ratio, double width) {
  const TetMesh mesh = mesh_of(kBlock, cells);
  const precompute::QuadraticTets tets = quadratic_of(mesh, poisson_ratio, clamp_of(kBlock, cells));
  return dents(tets.system, loads_on(tets.nodes, mesh, true, width));
}

}  // namespace

Table load_table() {
  Table table{
      "| load on | tets | Poisson ratio | linear, pressed | smoothed, pressed | linear, sheared | smoothed, sheared |\n"
      "| --- | --- | --- | --- | --- | --- | --- |\n",
      ""};
  for (const double width : {0.0, 0.25, 0.5})
    for (const double poisson_ratio : {0.3, 0.49}) {
      Eigen::Array2d reference = quadratic_dents(kBlock.cells.back(), poisson_ratio, width);
      for (const std::array<int, 3>& cells : kBlock.cells) {
        if (width == 0) reference = quadratic_dents(cells, poisson_ratio, width);  // without a limit
        const TetMesh mesh = mesh_of(kBlock, cells);
        const FlagVector clamp = clamp_of(kBlock, cells);
        std::array<Eigen::Array2d, 2> deep;
        for (const Formulation formulation : {Formulation::kLinear, Formulation::kSmoothed})
          deep[formulation == Formulation::kSmoothed] =
              dents(precompute::build_elastic_system(mesh, material_of(mesh, poisson_ratio, formulation, clamp), clamp),
                    loads_on(mesh.vertices, mesh, false, width)) /
              reference;
        table.rows += fmt::format("| {} | {} | {} | {:.2f} | {:.2f} | {:.2f} | {:.2f} |\n",
                                  width > 0 ? fmt::format("{} x {} m", width, width) : "one vertex", mesh.tet_count(),
                                  poisson_ratio, deep[0][0], deep[1][0], deep[0][1], deep[1][1]);
      }
    }
  return table;
}

}  // namespace exmat::benchmarks
