// Softness of bodies of linear tets and of smoothed elements beside quadratic tets of a fine mesh of the same shape.
// Prints the table of docs/studies/stiffness.md, and renews it where the page is named:
//   exmat-stiffness-benchmark [PAGE.md]

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <fstream>
#include <functional>
#include <iterator>
#include <numbers>
#include <string>
#include <vector>

#include "common/core/error.h"
#include "common/core/log.h"
#include "common/mesh/geometry.h"
#include "precompute/fem/quadratic_tets.h"
#include "precompute/modes/mesh_stiffness.h"
#include "precompute/solvers/eigenpairs.h"
#include "tests/support/box_mesh.h"
#include "tests/support/random.h"

namespace exmat::benchmarks {
namespace {

using precompute::ElasticSystem;

constexpr std::array kPoissonRatios = {0.3, 0.45, 0.49, 0.499};
constexpr Eigen::Index kModes = 6;
constexpr double kMoved = 0.2;  // of an edge: how far vertices of unstructured meshes are moved

// A shape that is clamped where x = 0, by a grid of cells along, across and through.
struct Shape {
  std::string name;
  std::vector<std::array<int, 3>> cells;  // from coarse to fine
  std::array<double, 3> lengths;
  std::function<bool(const Eigen::Vector3d&)> holds;       // whether a tet about this point belongs to it
  std::function<Eigen::Vector3d(Eigen::Vector3d)> placed;  // of a vertex of the grid
};

Eigen::Vector3d as_it_is(Eigen::Vector3d x) { return x; }
bool everywhere(const Eigen::Vector3d&) { return true; }

// Most of a ring of radius 1 about y, open at its lower end.
Eigen::Vector3d rolled(Eigen::Vector3d x) {
  const double angle = 1.5 * std::numbers::pi * x[0], radius = 1.15 - x[2];
  return {radius * std::sin(angle), x[1], -radius * std::cos(angle)};
}

const std::vector<Shape> kShapes = {
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

// Vertices of the grid that no tet has are left out; those inside are moved where the mesh is to be unstructured.
TetMesh mesh_of(const Shape& shape, const std::array<int, 3>& cells, bool unstructured) {
  const TetMesh grid = test::box_mesh(cells, shape.lengths);
  std::vector<Eigen::Index> kept;
  for (Eigen::Index t = 0; t < grid.tet_count(); ++t)
    if (shape.holds(tet_positions(grid, t).colwise().mean().transpose())) kept.push_back(t);
  TetMesh mesh;
  mesh.tets = grid.tets(kept, Eigen::all);
  std::vector<std::int32_t> place(static_cast<std::size_t>(grid.vertex_count()), -1);
  std::vector<std::int32_t> used;
  for (std::int32_t& vertex : mesh.tets.reshaped()) {
    std::int32_t& at = place[static_cast<std::size_t>(vertex)];
    if (at < 0) {
      at = static_cast<std::int32_t>(used.size());
      used.push_back(vertex);
    }
    vertex = at;
  }
  mesh.vertices = grid.vertices(used, Eigen::all);
  const Eigen::Index count = std::ssize(used);
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

// Work of loads of the body on what they bend, stretch and twist, and the lowest frequencies.
struct Response {
  Eigen::Vector4d work;         // of the weight along x, y, z, and of a turn about the x axis through the middle
  Eigen::VectorXd frequencies;  // [rad/s]
};

Response response_of(const ElasticSystem& system, const VertexArray& nodes) {
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

TetMaterials material(const TetMesh& mesh, double poisson_ratio, Formulation formulation) {
  const Eigen::VectorXd ones = Eigen::VectorXd::Ones(mesh.tet_count());
  return {1000 * ones,          1e6 * ones,
          poisson_ratio * ones, MaterialModel::kStableNeoHookean,
          formulation,          formulation == Formulation::kSmoothed ? kVarianceFactor : 0};
}

FlagVector clamp_of(const Shape& shape, const std::array<int, 3>& cells) {
  const TetMesh grid = mesh_of({shape.name, shape.cells, shape.lengths, shape.holds, as_it_is}, cells, false);
  return (grid.vertices.col(0).array() < 1e-9).cast<std::uint8_t>();
}

// Softest and stiffest of the three loads and of the frequencies, over the reference: 1 is right.
std::string cells_of(const Response& response, const Response& reference, double beta) {
  const Eigen::Vector4d soft = response.work.cwiseQuotient(reference.work);
  const Eigen::VectorXd fast = response.frequencies.cwiseQuotient(reference.frequencies);
  return fmt::format("{:.2f} | {:.2f} | {:.2f} | {:.2f} | {:.2f} to {:.2f}{}", soft[1], soft[2], soft[3], soft[0],
                     fast.minCoeff(), fast.maxCoeff(), beta > 0 ? fmt::format(" | {:.2f}", beta) : " |");
}

std::string table() {
  std::string text =
      "| shape | tets | Poisson ratio | elements | sag along y | sag along z | twist | stretch | frequencies | beta |\n"
      "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n";
  for (const Shape& shape : kShapes)
    for (const double poisson_ratio : kPoissonRatios) {
      const TetMesh fine = mesh_of(shape, shape.cells.back(), false);
      const precompute::QuadraticTets quadratic = precompute::quadratic_tets(
          fine, material(fine, poisson_ratio, Formulation::kLinear), clamp_of(shape, shape.cells.back()));
      const Response reference = response_of(quadratic.system, quadratic.nodes);
      for (const std::array<int, 3>& cells : shape.cells)
        for (const bool unstructured : {false, true}) {
          if (unstructured && cells != shape.cells[1]) continue;
          const TetMesh mesh = mesh_of(shape, cells, unstructured);
          const FlagVector clamp = clamp_of(shape, cells);
          for (const Formulation formulation : {Formulation::kLinear, Formulation::kSmoothed}) {
            TetMaterials materials = material(mesh, poisson_ratio, formulation);
            if (formulation == Formulation::kSmoothed)
              if (const auto found = precompute::mesh_stiffness(mesh, materials, clamp, shape.name))
                materials.variance_factor = found->variance_factor;
            const Response response =
                response_of(precompute::build_elastic_system(mesh, materials, clamp), mesh.vertices);
            const std::string row = fmt::format("| {} | {}{} | {} | {} | {} |\n", shape.name, mesh.tet_count(),
                                                unstructured ? ", moved" : "", poisson_ratio, name_of(formulation),
                                                cells_of(response, reference, materials.variance_factor));
            fmt::print(stderr, "{}", row);
            text += row;
          }
        }
    }
  return text;
}

void renew(const std::string& page, const std::string& table) {
  std::ifstream in(page);
  std::string text((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  const std::size_t begin = text.find("| shape | tets |"), end = text.find("\n\n", begin);
  if (begin == std::string::npos || end == std::string::npos)
    throw InputError({page, "", "the table that begins with | shape | tets |", "none", ""});
  text.replace(begin, end + 1 - begin, table);
  std::ofstream(page) << text;
}

}  // namespace
}  // namespace exmat::benchmarks

int main(int argc, char** argv) {
  const std::string table = exmat::benchmarks::table();
  fmt::print("{}", table);
  if (argc > 1) exmat::benchmarks::renew(argv[1], table);
}
