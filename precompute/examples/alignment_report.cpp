#include "precompute/examples/alignment_report.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cctype>
#include <fmt/format.h>
#include <vector>

#include "common/core/atomic_file.h"
#include "common/core/command_files.h"
#include "common/core/decompositions.h"
#include "common/core/error.h"
#include "common/core/log.h"
#include "common/core/markup.h"
#include "common/mesh/geometry.h"
#include "precompute/alignment/surface_tree.h"
#include "precompute/drawing/surface_picture.h"
#include "precompute/drawing/table.h"

namespace exmat::precompute {
namespace {

constexpr int kTetCell = 10;  // VTK's number of a tetrahedron

// A name as a part of a file's name.
std::string file_name(std::string name) {
  for (char& c : name)
    if (std::isalnum(static_cast<unsigned char>(c)) == 0 && c != '-' && c != '.') c = '_';
  return name;
}

constexpr double kTilt = 0.35;         // of the view, out of the principal axis [rad]
constexpr double kFarthest = 0.1;      // of the body's size: the end of the colours
constexpr double kLostWarning = 0.25;  // of the displacement, by the eigenfunctions
const Eigen::Vector3d kNear(225, 225, 225), kFar(200, 0, 0), kRest(170, 170, 170), kTransferred(224, 128, 64),
    kGiven(64, 128, 224);

PaintedSurface by_distance(const VertexArray& vertices, const TriangleArray& triangles,
                           const Eigen::VectorXd& distances, double farthest) {
  PaintedSurface painted(vertices, triangles, kNear);
  for (std::size_t k = 0; k < painted.colours.size(); ++k) {
    const double share = std::min(1.0, distances[static_cast<Eigen::Index>(k)] / farthest);
    painted.colours[k] = (1 - share) * kNear + share * kFar;
  }
  return painted;
}

/// Views along the thinnest and along the middle principal axis of the body at rest, a little from above.
std::vector<PictureView> views_of(const TetMesh& rest, const std::vector<const VertexArray*>& shown) {
  const VertexArray centred = rest.vertices.rowwise() - rest.vertices.colwise().mean();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> principal(centred.transpose() * centred);
  std::vector<PictureView> views;
  for (const int along : {0, 1}) {
    const Eigen::Vector3d right = principal.eigenvectors().col(2), to_viewer = principal.eigenvectors().col(along);
    Eigen::Matrix3d axes;
    axes << right.transpose(), to_viewer.cross(right).transpose(), to_viewer.transpose();
    axes = Eigen::AngleAxisd(kTilt, Eigen::Vector3d::UnitX()) *
           Eigen::AngleAxisd(kTilt, Eigen::Vector3d::UnitY()).toRotationMatrix() * axes;
    views.emplace_back(axes, shown);
  }
  return views;
}

std::string what_to_change(const AlignmentOutcome& outcome) {
  if (outcome.verdict != AlignmentVerdict::kGood) return outcome.message;
  if (outcome.shape_space_error > kLostWarning)
    return fmt::format(
        "the pose came over well, but the eigenfunctions lose {:.0f} % of it; more "
        "shape_space.eigenfunctions hold more",
        100 * outcome.shape_space_error);
  return "nothing to change";
}

std::string section(const TetMesh& rest, const ReportedPose& pose) {
  const double size = bounding_box_diagonal(rest.vertices);
  const Eigen::VectorXd there = surface_distances(pose.transferred, pose.given);
  const Eigen::VectorXd back = surface_distances(pose.given, pose.transferred);
  const TriangleArray own = surface_triangles(rest.tets), others = surface_triangles(pose.given.tets);
  const VertexArray &transferred = pose.transferred.vertices, &given = pose.given.vertices;
  const std::vector<std::pair<std::string, PaintedSurface>> columns{
      {"object at rest", {rest.vertices, own, kRest}},
      {"pose on the object", {transferred, own, kTransferred}},
      {"pose as given", {given, others, kGiven}},
      {fmt::format("on the object: up to {:.1f} % from the given", 100 * there.maxCoeff() / size),
       by_distance(transferred, own, there, kFarthest * size)},
      {fmt::format("given: up to {:.1f} % from that on the object", 100 * back.maxCoeff() / size),
       by_distance(given, others, back, kFarthest * size)}};
  const AlignmentOutcome& outcome = pose.outcome;
  std::string text = fmt::format(
      "<section class=\"{0}\">\n<h2>{1} <span>{0}</span></h2>\n<p><b>{2}.</b></p>\n"
      "<p>{3}, doubt {4:.2f}, residual {5:.1f} % of the body's size, {6:.1f} % of the volume inside out, {7:.0f} % "
      "lost by the eigenfunctions</p>\n<table>\n<tr>",
      name_of(outcome.verdict), escaped(outcome.name), escaped(what_to_change(outcome)), escaped(outcome.method),
      outcome.doubt, 100 * outcome.residual, 100 * outcome.inverted_fraction, 100 * outcome.shape_space_error);
  for (const auto& [label, painted] : columns) text += fmt::format("<th>{}</th>", label);
  text += "</tr>\n";
  for (const PictureView& view : views_of(rest, {&rest.vertices, &transferred, &given})) {
    text += "<tr>\n";
    for (const auto& [label, painted] : columns) text += "<td>" + surface_svg(painted, view) + "</td>\n";
    text += "</tr>\n";
  }
  return text + "</table>\n</section>\n";
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

Eigen::VectorXd surface_distances(const TetMesh& from, const TetMesh& to) {
  const VertexArray middles = triangle_samples(from.vertices, surface_triangles(from.tets)).centres;
  const SurfaceTree tree(to.vertices, surface_triangles(to.tets));
  Eigen::VectorXd distances(middles.rows());
#pragma omp parallel for schedule(static)
  for (Eigen::Index k = 0; k < middles.rows(); ++k) {
    const Eigen::Vector3d middle = middles.row(k).transpose();
    distances[k] = (tree.nearest(middle).position - middle).norm();
  }
  return distances;
}

std::string alignment_page(const std::string& title, const TetMesh& rest, const std::vector<ReportedPose>& poses) {
  const auto colour = [](const Eigen::Vector3d& c) {
    return fmt::format("rgb({:.0f}, {:.0f}, {:.0f})", c[0], c[1], c[2]);
  };
  const std::string style = fmt::format(
      "section {{ border-left: 6px solid #4a4; padding-left: 1em; margin-bottom: 2em; overflow-x: auto; }}\n"
      "section.doubtful {{ border-color: #e90; }} section.refused {{ border-color: #c00; }} section svg {{ max-width: "
      "none; }}\nh2 span {{ font-size: 60%; font-weight: normal; }} th {{ font-weight: normal; text-align: left; }}\n"
      ".scale {{ display: inline-block; width: 16em; height: 0.8em; vertical-align: middle;\n"
      "  background: linear-gradient(to right, {}, {}); }}\n",
      colour(kNear), colour(kFar));
  std::string body = fmt::format(
      "<p>Distance of the surfaces: 0 <span class=\"scale\"></span> {:.0f} % of the body's size and more. The last "
      "picture of a row shows what the pose has and the object lacks, such as a limb.</p>\n",
      100 * kFarthest);
  for (const ReportedPose& pose : poses) body += section(rest, pose);
  return html_page(title + ": alignment of the examples", body, style);
}

void claim_alignment_report(const AssetConfig& asset, const std::filesystem::path& folder) {
  claim_output(folder / "index.html", "--alignment-report");
  for (const ExampleConfig& example : asset.examples)
    for (const char* ending : {".vtk", "_example.vtk"})
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
    write_file_atomically(folder / (base + ".vtk"), vtk_text(transferred, displacement, pose.name + ", transferred"));
    write_file_atomically(folder / (base + "_example.vtk"), vtk_text(beside, {}, pose.name + ", the example"));
    const auto outcome = std::ranges::find(stage.alignments, pose.name, &AlignmentOutcome::name);
    if (outcome != stage.alignments.end()) page.push_back({*outcome, transferred, original});
  }
  write_file_atomically(folder / "index.html", alignment_page(asset, object, page));
  log::info(fmt::format("alignment report: {} poses in {}", input.poses.size(), (folder / "index.html").string()));
}

}  // namespace exmat::precompute
