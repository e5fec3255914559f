// Linear tets and smoothed elements beside quadratic tets of the finest mesh of the same shape.

#include <fmt/format.h>

#include "tests/benchmark/stiffness/shapes.h"

namespace exmat::benchmarks {
namespace {

constexpr std::array kPoissonRatios = {0.3, 0.45, 0.49, 0.499};

std::string cells_of(const Response& share, double beta) {
  const auto& [soft, fast] = share;
  return fmt::format("{:.2f} | {:.2f} | {:.2f} | {:.2f} | {:.2f} to {:.2f}{}", soft[1], soft[2], soft[3], soft[0],
                     fast.minCoeff(), fast.maxCoeff(), beta > 0 ? fmt::format(" | {:.2f}", beta) : " |");
}

std::string rows_of(const Shape& shape, double poisson_ratio) {
  std::string rows;
  const precompute::QuadraticTets quadratic =
      quadratic_of(mesh_of(shape, shape.cells.back()), poisson_ratio, clamp_of(shape, shape.cells.back()));
  const Response reference = response_of(quadratic.system, quadratic.nodes);
  for (const std::array<int, 3>& cells : shape.cells)
    for (const bool unstructured : {false, true}) {
      if (unstructured && cells != shape.cells[1]) continue;
      const TetMesh mesh = mesh_of(shape, cells, unstructured);
      const FlagVector clamp = clamp_of(shape, cells);
      for (const Formulation formulation : {Formulation::kLinear, Formulation::kSmoothed}) {
        const TetMaterials materials = material_of(mesh, poisson_ratio, formulation, clamp);
        const Response response = response_of(precompute::build_elastic_system(mesh, materials, clamp), mesh.vertices);
        rows += fmt::format("| {} | {}{} | {} | {} | {} |\n", shape.name, mesh.tet_count(),
                            unstructured ? ", moved" : "", poisson_ratio, name_of(formulation),
                            cells_of(over(response, reference), materials.variance_factor));
      }
    }
  return rows;
}

}  // namespace

Table shape_table() {
  Table table{
      "| shape | tets | Poisson ratio | elements | sag along y | sag along z | twist | stretch | frequencies | beta |\n"
      "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n",
      ""};
  for (const Shape& shape : all_shapes())
    for (const double poisson_ratio : kPoissonRatios) table.rows += rows_of(shape, poisson_ratio);
  return table;
}

}  // namespace exmat::benchmarks
