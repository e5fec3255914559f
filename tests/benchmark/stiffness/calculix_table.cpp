// Quadratic tets of CalculiX (C3D10) beside those that the other tables take as reference.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fmt/format.h>
#include <fmt/os.h>
#include <fstream>
#include <map>
#include <utility>

#include "common/core/error.h"
#include "tests/benchmark/stiffness/shapes.h"

namespace exmat::benchmarks {
namespace {

constexpr std::array<std::array<int, 2>, 6> kEdges{{{0, 1}, {1, 2}, {2, 0}, {0, 3}, {1, 3}, {2, 3}}};
// In its input a step for each of these, by a unit acceleration.
constexpr std::array kWeights = {"1,0,0", "0,1,0", "0,0,1"};

void write_input(const std::filesystem::path& file, const TetMesh& mesh, const FlagVector& clamp,
                 double poisson_ratio) {
  std::map<std::pair<int, int>, Eigen::Index> middles;
  std::string nodes, elements, fixed;
  // It reads twenty characters of a number.
  const auto add = [&](Eigen::Index node, const Eigen::RowVector3d& x, bool clamped) {
    nodes += fmt::format("{},{:.12g},{:.12g},{:.12g}\n", node + 1, x[0], x[1], x[2]);
    if (clamped) fixed += fmt::format("{},1,3\n", node + 1);
  };
  for (Eigen::Index v = 0; v < mesh.vertex_count(); ++v) add(v, mesh.vertices.row(v), clamp[v] != 0);
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t) {
    elements += fmt::format("{}", t + 1);
    for (int corner = 0; corner < 4; ++corner) elements += fmt::format(",{}", mesh.tets(t, corner) + 1);
    for (const auto& [a, b] : kEdges) {
      const std::pair<int, int> ends = std::minmax(mesh.tets(t, a), mesh.tets(t, b));
      const Eigen::Index next = mesh.vertex_count() + std::ssize(middles);
      const auto [middle, is_new] = middles.try_emplace(ends, next);
      if (is_new)
        add(next, (mesh.vertices.row(ends.first) + mesh.vertices.row(ends.second)) / 2,
            clamp[ends.first] != 0 && clamp[ends.second] != 0);
      elements += fmt::format(",{}", middle->second + 1);
    }
    elements += '\n';
  }
  auto out = fmt::output_file(file.string());
  out.print("*NODE\n{}*ELEMENT,TYPE=C3D10,ELSET=ALL\n{}*MATERIAL,NAME=M\n*ELASTIC\n{},{}\n*DENSITY\n{}\n", nodes,
            elements, kYoungsModulus, poisson_ratio, kDensity);
  out.print("*SOLID SECTION,ELSET=ALL,MATERIAL=M\n*BOUNDARY\n{}", fixed);
  for (const char* weight : kWeights)
    out.print("*STEP\n*STATIC\n*DLOAD,OP=NEW\nALL,GRAV,1,{}\n*EL PRINT,ELSET=ALL,TOTALS=ONLY\nELSE\n*END STEP\n",
              weight);
  out.print("*STEP\n*FREQUENCY\n{}\n*END STEP\n", kModes);
}

// The first lines of its output with numbers: the elastic energy of each weight, then rows of eigenvalues.
Response read_output(const std::filesystem::path& file) {
  Response response{Eigen::Vector4d::Ones(), Eigen::VectorXd(kModes)};
  std::ifstream in(file);
  std::string line;
  for (std::size_t weight = 0, mode = 0; mode < kModes && std::getline(in, line);) {
    if (line.find("total internal energy") != std::string::npos && weight < kWeights.size()) {
      double energy = 0;
      in >> energy;
      response.work[static_cast<Eigen::Index>(weight++)] = 2 * energy;
    }
    int number = 0;
    double eigenvalue = 0;
    if (weight == kWeights.size() && std::sscanf(line.c_str(), " %d %lf", &number, &eigenvalue) == 2) {
      if (number != static_cast<int>(mode) + 1) break;
      response.frequencies[static_cast<Eigen::Index>(mode++)] = std::sqrt(eigenvalue);
      if (mode == kModes) return response;
    }
  }
  throw InputError({file, "", "energies and frequencies", "none", ""});
}

Response calculix(const TetMesh& mesh, const FlagVector& clamp, double poisson_ratio) {
  const std::filesystem::path folder = std::filesystem::temp_directory_path() / "exmat-calculix";
  std::filesystem::create_directories(folder);
  write_input(folder / "shape.inp", mesh, clamp, poisson_ratio);
  const std::string command = fmt::format("cd {} && ccx -i shape > log 2>&1", folder.string());
  if (std::system(command.c_str()) != 0) throw InputError({folder / "log", "", "a solution", "an error", ""});
  const Response response = read_output(folder / "shape.dat");
  std::filesystem::remove_all(folder);
  return response;
}

}  // namespace

std::optional<Table> calculix_table() {
  if (std::system("command -v ccx > /dev/null") != 0) return std::nullopt;
  Table table{
      "| shape | tets of CalculiX | Poisson ratio | sag along y | sag along z | stretch | frequencies |\n"
      "| --- | --- | --- | --- | --- | --- | --- |\n",
      ""};
  for (const Shape& shape : all_shapes())
    for (const double poisson_ratio : {0.3, 0.49}) {
      const std::array<int, 3>& cells = shape.cells.back();
      const TetMesh mesh = mesh_of(shape, cells);
      const precompute::QuadraticTets quadratic = quadratic_of(mesh, poisson_ratio, clamp_of(shape, cells));
      const Response reference = response_of(quadratic.system, quadratic.nodes);
      std::vector<std::array<int, 3>> meshes{cells};
      if (shape.name == "ring") meshes.push_back({2 * cells[0], 2 * cells[1], 2 * cells[2]});
      for (const std::array<int, 3>& its : meshes) {
        const TetMesh finer = mesh_of(shape, its);
        const auto [soft, fast] = over(calculix(finer, clamp_of(shape, its), poisson_ratio), reference);
        table.rows +=
            fmt::format("| {} | {} | {} | {:.3f} | {:.3f} | {:.3f} | {:.3f} to {:.3f} |\n", shape.name,
                        finer.tet_count(), poisson_ratio, soft[1], soft[2], soft[0], fast.minCoeff(), fast.maxCoeff());
      }
    }
  return table;
}

}  // namespace exmat::benchmarks
