// Cages of a surface from coarse to fine: does the number of cells change the material?

#include <cstdint>
#include <filesystem>
#include <fmt/format.h>
#include <utility>

#include "precompute/mesh_io/surface_file.h"
#include "precompute/meshing/cage.h"
#include "tests/benchmark/stiffness/shapes.h"

namespace exmat::benchmarks {
namespace {

constexpr std::array kCells = {500, 2000, 8000};
constexpr double kClamped = 0.08;  // of the longest side, from its lower end

struct CagedBody {
  TetMesh mesh;
  FlagVector clamp;
};

CagedBody caged(const SurfaceMesh& surface, int cells) {
  CagedBody body{precompute::make_cage(surface, {cells, {}}, "surface").mesh, {}};
  const Eigen::RowVector3d low = surface.vertices.colwise().minCoeff();
  const Eigen::RowVector3d size = surface.vertices.colwise().maxCoeff() - low;
  Eigen::Index up = 0;
  size.maxCoeff(&up);
  body.clamp = (body.mesh.vertices.col(up).array() < low[up] + kClamped * size[up]).cast<std::uint8_t>();
  return body;
}

std::string rows_of(const std::string& name, const std::vector<CagedBody>& bodies, double poisson_ratio) {
  std::string rows;
  const CagedBody& finest = bodies.back();
  const precompute::QuadraticTets quadratic = quadratic_of(finest.mesh, poisson_ratio, finest.clamp);
  const Response reference = response_of(quadratic.system, quadratic.nodes);
  for (const CagedBody& body : bodies) {
    const precompute::QuadraticTets own = quadratic_of(body.mesh, poisson_ratio, body.clamp);
    const auto cells_of = [&](const Response& response) {
      const auto [soft, fast] = over(response, reference);
      return fmt::format("{:.2f} to {:.2f} | {:.2f} to {:.2f}", soft.head<3>().minCoeff(), soft.head<3>().maxCoeff(),
                         fast.minCoeff(), fast.maxCoeff());
    };
    const auto row = [&](const std::string& elements, const Response& response) {
      rows += fmt::format("| {} | {} | {} | {} | {} |\n", name, body.mesh.tet_count(), poisson_ratio, elements,
                          cells_of(response));
    };
    for (const Formulation formulation : {Formulation::kLinear, Formulation::kSmoothed})
      row(std::string(name_of(formulation)),
          response_of(precompute::build_elastic_system(
                          body.mesh, material_of(body.mesh, poisson_ratio, formulation, body.clamp), body.clamp),
                      body.mesh.vertices));
    row("quadratic", response_of(own.system, own.nodes));
  }
  return rows;
}

}  // namespace

std::optional<Table> cage_table() {
  if (precompute::mesher_version() == "none") return std::nullopt;
  Table table{
      "| surface | tets | Poisson ratio | elements | sag | frequencies |\n"
      "| --- | --- | --- | --- | --- | --- |\n",
      ""};
  const std::filesystem::path examples = EXMAT_SOURCE_DIR "/examples";
  for (const auto& [name, file] :
       {std::pair{"teddy", "07_teddy_global/surface.obj"}, std::pair{"figure", "09_figure_from_surface/figure.glb"}}) {
    const SurfaceMesh surface = precompute::read_surface_file(examples / file).mesh;
    std::vector<CagedBody> bodies;
    for (const int cells : kCells) bodies.push_back(caged(surface, cells));
    for (const double poisson_ratio : {0.3, 0.45, 0.49}) table.rows += rows_of(name, bodies, poisson_ratio);
  }
  return table;
}

}  // namespace exmat::benchmarks
