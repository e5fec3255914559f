#include "tests/benchmark/stiffness/shapes.h"

#include <Eigen/Geometry>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <numbers>

#include "common/mesh/geometry.h"
#include "precompute/modes/mesh_stiffness.h"
#include "precompute/solvers/eigenpairs.h"
#include "tests/support/posed_bodies.h"
#include "tests/support/random.h"

namespace exmat::benchmarks {
namespace {

constexpr double kMoved = 0.2;  // of an edge: how far vertices of unstructured meshes are moved

Eigen::Vector3d as_it_is(Eigen::Vector3d x) { return x; }
bool everywhere(const Eigen::Vector3d&) { return true; }

// Most of a ring of radius 1 about y, open at its lower end.
Eigen::Vector3d rolled(Eigen::Vector3d x) {
  const double angle = 1.5 * std::numbers::pi * x[0], radius = 1.15 - x[2];
  return {radius * std::sin(angle), x[1], -radius * std::cos(angle)};
}

}  // namespace

const std::vector<Shape>& all_shapes() {
  static const std::vector<Shape> shapes = {
      {"bar 1 : 4", {{8, 2, 2}, {16, 4, 4}, {24, 6, 6}}, {1.6, 0.4, 0.4}, everywhere, as_it_is},
      {"bar 1 : 10", {{20, 2, 2}, {30, 3, 3}, {50, 5, 5}}, {4, 0.4, 0.4}, everywhere, as_it_is},
      {"bar 1 : 20", {{40, 2, 2}, {60, 3, 3}, {80, 4, 4}}, {8, 0.4, 0.4}, everywhere, as_it_is},
      {"plate, one tet thick", {{9, 9, 1}, {18, 18, 1}, {36, 36, 1}}, {1, 1, 0.1}, everywhere, as_it_is},
      {"plate", {{8, 8, 2}, {14, 14, 2}, {24, 24, 3}}, {1, 1, 0.1}, everywhere, as_it_is},
      {"L",
       {{8, 8, 2}, {16, 16, 4}, {24, 24, 6}},
       {1.6, 1.6, 0.4},
       [](const Eigen::Vector3d& x) { return x[0] > 1.2 || x[1] < 0.4; },
       as_it_is},
      {"ring", {{20, 2, 2}, {36, 3, 3}, {60, 5, 5}}, {1, 0.3, 0.3}, everywhere, rolled}};
  return shapes;
}

TetMesh mesh_of(const Shape& shape, const std::array<int, 3>& cells, bool unstructured) {
  TetMesh mesh = test::without(test::box_mesh(cells, shape.lengths),
                               [&](const Eigen::RowVector3d& x) { return !shape.holds(x.transpose()); });
  const Eigen::Index count = mesh.vertex_count();
  if (unstructured) {
    const TriangleArray surface = surface_triangles(mesh.tets);
    std::vector<bool> outside(static_cast<std::size_t>(count), false);
    for (Eigen::Index i = 0; i < surface.size(); ++i) outside[static_cast<std::size_t>(surface.data()[i])] = true;
    const Eigen::MatrixXd moves = test::random_matrix(count, 3, 5);
    for (Eigen::Index v = 0; v < count; ++v)
      for (int axis = 0; axis < 3 && !outside[static_cast<std::size_t>(v)]; ++axis)
        mesh.vertices(v, axis) += kMoved * moves(v, axis) * shape.lengths[static_cast<std::size_t>(axis)] /
                                  cells[static_cast<std::size_t>(axis)];
  }
  for (auto x : mesh.vertices.rowwise()) x = shape.placed(x.transpose()).transpose();
  return mesh;
}

Response response_of(const precompute::ElasticSystem& system, const VertexArray& nodes) {
  const precompute::SemidefiniteSolver solver(system.stiffness, system.mass * system.null_space, "shape", system.rigid);
  Eigen::MatrixXd fields = Eigen::MatrixXd::Zero(nodes.size(), 4);
  const Eigen::RowVector3d middle = (nodes.colwise().maxCoeff() + nodes.colwise().minCoeff()) / 2;
  for (Eigen::Index v = 0; v < nodes.rows(); ++v) {
    fields.block<3, 3>(3 * v, 0).setIdentity();
    fields.col(3).segment<3>(3 * v) = Eigen::Vector3d::UnitX().cross((nodes.row(v) - middle).transpose());
  }
  const Eigen::MatrixXd loads = system.restrict(system.full_mass * fields);
  return {loads.cwiseProduct(solver.solve(loads)).colwise().sum().transpose(),
          precompute::smallest_eigenpairs(system.stiffness, system.mass, solver, kModes).values.cwiseSqrt()};
}

Response over(const Response& response, const Response& reference) {
  return {response.work.cwiseQuotient(reference.work), response.frequencies.cwiseQuotient(reference.frequencies)};
}

FlagVector clamp_of(const Shape& shape, const std::array<int, 3>& cells) {
  const TetMesh grid = mesh_of({shape.name, shape.cells, shape.lengths, shape.holds, as_it_is}, cells, false);
  return (grid.vertices.col(0).array() < 1e-9).cast<std::uint8_t>();
}

TetMaterials material_of(const TetMesh& mesh, double poisson_ratio, Formulation formulation, const FlagVector& clamp) {
  const Eigen::VectorXd ones = Eigen::VectorXd::Ones(mesh.tet_count());
  TetMaterials materials{kDensity * ones,      kYoungsModulus * ones,
                         poisson_ratio * ones, MaterialModel::kStableNeoHookean,
                         formulation,          formulation == Formulation::kSmoothed ? kVarianceFactor : 0};
  if (formulation == Formulation::kSmoothed)
    if (const auto found = precompute::mesh_stiffness(mesh, materials, clamp, "shape"))
      materials.variance_factor = found->variance_factor;
  return materials;
}

precompute::QuadraticTets quadratic_of(const TetMesh& mesh, double poisson_ratio, const FlagVector& clamp) {
  return precompute::quadratic_tets(mesh, material_of(mesh, poisson_ratio, Formulation::kLinear, clamp), clamp);
}

}  // namespace exmat::benchmarks
