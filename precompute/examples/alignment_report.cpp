#include "precompute/examples/alignment_report.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cctype>
#include <fmt/format.h>
#include <numeric>
#include <vector>

#include "common/core/atomic_file.h"
#include "common/core/command_files.h"
#include "common/core/error.h"
#include "common/core/log.h"
#include "common/core/markup.h"
#include "common/mesh/geometry.h"
#include "precompute/examples/alignment_page.h"

namespace exmat::precompute {
namespace {

constexpr double kPanel = 320, kMargin = 16, kTitle = 28;  // of the picture [px]
constexpr int kTetCell = 10;                               // VTK's number of a tetrahedron

// A name as a part of a file's name.
std::string file_name(std::string name) {
  for (char& c : name)
    if (std::isalnum(static_cast<unsigned char>(c)) == 0 && c != '-' && c != '.') c = '_';
  return name;
}

// The triangles that face the viewer, the farthest first, shaded by their slope.
std::string panel(const TetMesh& mesh, int axis, double scale, const Eigen::Vector2d& middle, const char* tint) {
  const int right = (axis + 1) % 3, up = (axis + 2) % 3;
  const TriangleArray triangles = surface_triangles(mesh.tets);
  const Eigen::RowVector3d centre = 0.5 * (mesh.vertices.colwise().maxCoeff() + mesh.vertices.colwise().minCoeff());
  std::vector<Eigen::Index> order(static_cast<std::size_t>(triangles.rows()));
  std::iota(order.begin(), order.end(), Eigen::Index{0});
  const auto depth = [&](Eigen::Index k) { return mesh.vertices(triangles.row(k), axis).mean(); };
  std::ranges::stable_sort(order, {}, depth);
  std::string text = fmt::format("<g stroke=\"#333\" stroke-width=\"0.3\" fill=\"{}\">\n", tint);
  for (const Eigen::Index k : order) {
    const Eigen::Vector3d a = mesh.vertices.row(triangles(k, 0)), b = mesh.vertices.row(triangles(k, 1)),
                          c = mesh.vertices.row(triangles(k, 2));
    const double slope = (b - a).cross(c - a).normalized()[axis];
    if (!(slope > 0)) continue;
    std::string points;
    for (const Eigen::Vector3d& x : {a, b, c})
      points += fmt::format("{:.1f},{:.1f} ", middle[0] + scale * (x[right] - centre[right]),
                            middle[1] - scale * (x[up] - centre[up]));
    text += fmt::format("<polygon points=\"{}\" fill-opacity=\"{:.2f}\"/>\n", points, 0.35 + 0.65 * slope);
  }
  return text + "</g>\n";
}

}  // namespace

std::string vtk_text(const TetMesh& mesh, const VertexArray& displacement, const std::string& title) {
  std::string text = fmt::format("# vtk DataFile Version 3.0\n{}\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS {} double\n",
                                 title.substr(0, 200), mesh.vertex_count());
  for (const auto& x : mesh.vertices.rowwise()) text += fmt::format("{:.9g} {:.9g} {:.9g}\n", x[0], x[1], x[2]);
  text += fmt::format("CELLS {} {}\n", mesh.tet_count(), 5 * mesh.tet_count());
  for (const auto& tet : mesh.tets.rowwise()) text += fmt::format("4 {} {} {} {}\n", tet[0], tet[1], tet[2], tet[3]);
  text += fmt::format("CELL_TYPES {}\n", mesh.tet_count());
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t) text += fmt::format("{}\n", kTetCell);
  if (displacement.rows() == 0) return text;
  text += fmt::format("POINT_DATA {}\nVECTORS displacement double\n", mesh.vertex_count());
  for (const auto& u : displacement.rowwise()) text += fmt::format("{:.9g} {:.9g} {:.9g}\n", u[0], u[1], u[2]);
  return text;
}

std::string svg_text(const TetMesh& left, const TetMesh& right, const std::string& title) {
  const double size =
      std::max({(left.vertices.colwise().maxCoeff() - left.vertices.colwise().minCoeff()).maxCoeff(),
                (right.vertices.colwise().maxCoeff() - right.vertices.colwise().minCoeff()).maxCoeff(), 1e-300});
  const double scale = (kPanel - 2 * kMargin) / size, width = 2 * kPanel, height = 3 * kPanel + kTitle;
  std::string text = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0:.0f}\" height=\"{1:.0f}\" viewBox=\"0 0 {0:.0f} "
      "{1:.0f}\">\n"
      "<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
      "<text x=\"8\" y=\"19\" font-family=\"sans-serif\" font-size=\"14\">{2}</text>\n",
      width, height, escaped(title));
  for (int axis = 0; axis < 3; ++axis) {
    const double row = kTitle + (axis + 0.5) * kPanel;
    text += panel(left, axis, scale, {0.5 * kPanel, row}, "#e08040");
    text += panel(right, axis, scale, {1.5 * kPanel, row}, "#4080e0");
  }
  return text + "</svg>\n";
}

void claim_alignment_report(const AssetConfig& asset, const std::filesystem::path& folder) {
  claim_output(folder / "index.html", "--alignment-report");
  for (const ExampleConfig& example : asset.examples)
    for (const char* ending : {".vtk", "_example.vtk", ".svg"})
      claim_output(folder / (file_name(example.name) + ending),
                   fmt::format("--alignment-report, example {}", example.name));
}

void write_alignment_report(const std::string& asset, const TetMesh& object, const ExampleInput& input,
                            const ShapeStage& stage, const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) throw WorkError(fmt::format("{}: cannot make the folder: {}", folder.string(), error.message()));
  std::vector<ReportedPose> page;
  for (std::size_t k = 0; k < input.poses.size(); ++k) {
    const PoseInput& pose = input.poses[k];
    const auto& [rotation, scale, displacement] = stage.poses[k];
    const TetMesh transferred{object.vertices + displacement, object.tets};
    TetMesh original{pose.mesh.vertices.rowwise() - centroid(pose.mesh).transpose(), pose.mesh.tets};
    original.vertices = scale * original.vertices * rotation.transpose();
    original.vertices.rowwise() += stage.data.centroid.transpose();
    // Beside it along z, the example to the right.
    TetMesh beside = original;
    const double step = 1.2 * bounding_box_diagonal(object.vertices);
    beside.vertices.col(2).array() += step;
    const std::string base = file_name(pose.name);
    const auto title = fmt::format("{}: transferred to the object (left), the example (right)", pose.name);
    write_file_atomically(folder / (base + ".vtk"), vtk_text(transferred, displacement, pose.name + ", transferred"));
    write_file_atomically(folder / (base + "_example.vtk"), vtk_text(beside, {}, pose.name + ", the example"));
    write_file_atomically(folder / (base + ".svg"), svg_text(transferred, original, title));
    const auto outcome = std::ranges::find(stage.alignments, pose.name, &AlignmentOutcome::name);
    if (outcome != stage.alignments.end()) page.push_back({*outcome, transferred, original});
  }
  write_file_atomically(folder / "index.html", alignment_page(asset, object, page));
  log::info(fmt::format("alignment report: {} poses in {}", input.poses.size(), (folder / "index.html").string()));
}

}  // namespace exmat::precompute
