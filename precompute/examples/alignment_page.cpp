#include "precompute/examples/alignment_page.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <numeric>

#include "common/core/markup.h"
#include "common/mesh/geometry.h"
#include "precompute/alignment/surface_tree.h"

namespace exmat::precompute {
namespace {

constexpr int kSide = 300;                   // of a picture [px]
constexpr double kFilled = 0.9;              // of it that the body takes
constexpr double kTilt = 0.35;               // of the view, out of the principal axis [rad]
constexpr std::size_t kMostPolygons = 5000;  // beyond these a picture is of pixels
constexpr int kShades = 12;                  // of these
constexpr double kFarthest = 0.1;            // of the body's size: the end of the colours
constexpr double kLostWarning = 0.25;        // of the displacement, by the eigenfunctions
const Eigen::Vector3d kNear(225, 225, 225), kFar(200, 0, 0), kRest(170, 170, 170), kTransferred(224, 128, 64),
    kGiven(64, 128, 224);

// A surface whose triangles have colours.
struct Painted {
  const VertexArray& vertices;
  TriangleArray triangles;
  std::vector<Eigen::Vector3d> colours;
};

Painted of_one_colour(const TetMesh& mesh, const Eigen::Vector3d& colour) {
  TriangleArray triangles = surface_triangles(mesh.tets);
  const auto count = static_cast<std::size_t>(triangles.rows());
  return {mesh.vertices, std::move(triangles), std::vector<Eigen::Vector3d>(count, colour)};
}

Painted by_distance(const TetMesh& mesh, const Eigen::VectorXd& distances, double farthest) {
  Painted painted = of_one_colour(mesh, kNear);
  for (std::size_t k = 0; k < painted.colours.size(); ++k) {
    const double share = std::min(1.0, distances[static_cast<Eigen::Index>(k)] / farthest);
    painted.colours[k] = (1 - share) * kNear + share * kFar;
  }
  return painted;
}

// What all pictures of a pose share: rows to the right, up and to the viewer, and the square that is seen.
struct View {
  Eigen::Matrix3d axes;
  Eigen::Vector2d centre;
  double scale;

  Eigen::Vector3d operator()(const Eigen::Vector3d& x) const {
    const Eigen::Vector3d seen = axes * x;
    return {0.5 * kSide + scale * (seen[0] - centre[0]), 0.5 * kSide - scale * (seen[1] - centre[1]), seen[2]};
  }
};

// Along the thinnest and along the middle principal axis of the body at rest, a little from above.
std::vector<View> views_of(const TetMesh& rest, const std::vector<const TetMesh*>& shown) {
  const VertexArray centred = rest.vertices.rowwise() - rest.vertices.colwise().mean();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> principal(centred.transpose() * centred);
  std::vector<View> views;
  for (const int along : {0, 1}) {
    View view{.axes = {}, .centre = Eigen::Vector2d::Zero(), .scale = 1};
    const Eigen::Vector3d right = principal.eigenvectors().col(2), to_viewer = principal.eigenvectors().col(along);
    const Eigen::Vector3d up = to_viewer.cross(right);
    view.axes << right.transpose(), up.transpose(), to_viewer.transpose();
    view.axes = Eigen::AngleAxisd(kTilt, Eigen::Vector3d::UnitX()) *
                Eigen::AngleAxisd(kTilt, Eigen::Vector3d::UnitY()).toRotationMatrix() * view.axes;
    Eigen::Array2d low = Eigen::Array2d::Constant(std::numeric_limits<double>::infinity()), high = -low;
    for (const TetMesh* mesh : shown) {
      const auto seen = (mesh->vertices * view.axes.topRows<2>().transpose()).eval();
      low = low.min(seen.colwise().minCoeff().transpose().array());
      high = high.max(seen.colwise().maxCoeff().transpose().array());
    }
    view.centre = 0.5 * (low + high);
    view.scale = kFilled * kSide / std::max((high - low).maxCoeff(), 1e-300);
    views.push_back(view);
  }
  return views;
}

// A triangle that faces the viewer, in pixels and depth, shaded by its slope.
struct Facing {
  Eigen::Matrix3d corners;  // a column each
  Eigen::Vector3d colour;
};

std::vector<Facing> facing(const Painted& painted, const View& view) {
  std::vector<Facing> found;
  for (Eigen::Index k = 0; k < painted.triangles.rows(); ++k) {
    Facing one;
    for (int i = 0; i < 3; ++i) one.corners.col(i) = view(painted.vertices.row(painted.triangles(k, i)).transpose());
    const Eigen::Vector3d a = one.corners.col(1) - one.corners.col(0), b = one.corners.col(2) - one.corners.col(0);
    const double turned = a[1] * b[0] - a[0] * b[1];  // the picture's y points down
    if (!(turned > 0)) continue;
    const Eigen::Vector3d in_space =
        Eigen::Vector3d(a[0], a[1], view.scale * a[2]).cross(Eigen::Vector3d(b[0], b[1], view.scale * b[2]));
    one.colour = (0.5 + 0.5 * turned / in_space.norm()) * painted.colours[static_cast<std::size_t>(k)];
    found.push_back(std::move(one));
  }
  std::ranges::stable_sort(found, {}, [](const Facing& one) { return one.corners.row(2).mean(); });
  return found;
}

std::string hex(const Eigen::Vector3d& colour) {
  const auto part = [&](int i) { return static_cast<int>(std::clamp(colour[i], 0.0, 255.0)); };
  return fmt::format("#{:02x}{:02x}{:02x}", part(0), part(1), part(2));
}

std::string polygons(const std::vector<Facing>& triangles) {
  std::string text = "<g stroke=\"#333\" stroke-width=\"0.2\">\n";
  for (const Facing& one : triangles)
    text += fmt::format("<path fill=\"{}\" d=\"M{:.1f} {:.1f} {:.1f} {:.1f} {:.1f} {:.1f}z\"/>\n", hex(one.colour),
                        one.corners(0, 0), one.corners(1, 0), one.corners(0, 1), one.corners(1, 1), one.corners(0, 2),
                        one.corners(1, 2));
  return text + "</g>\n";
}

// Triangles from the farthest to the nearest, each over those behind it; then runs of pixels of one colour.
std::string pixels(const std::vector<Facing>& triangles) {
  std::vector<std::string> colours(static_cast<std::size_t>(kSide) * kSide);
  constexpr double kStep = 256.0 / kShades;
  for (const Facing& one : triangles) {
    const std::string colour = hex(((one.colour.array() / kStep).round() * kStep).matrix());
    const Eigen::Vector2d a = one.corners.col(0).head<2>(), b = one.corners.col(1).head<2>(),
                          c = one.corners.col(2).head<2>();
    const auto first = [&](int i) { return std::max(0, static_cast<int>(std::min({a[i], b[i], c[i]}))); };
    const auto last = [&](int i) { return std::min(kSide - 1, static_cast<int>(std::max({a[i], b[i], c[i]}))); };
    const auto side = [](const Eigen::Vector2d& p, const Eigen::Vector2d& q, const Eigen::Vector2d& x) {
      return (q[1] - p[1]) * (x[0] - p[0]) - (q[0] - p[0]) * (x[1] - p[1]);
    };
    for (int y = first(1); y <= last(1); ++y)
      for (int x = first(0); x <= last(0); ++x) {
        const Eigen::Vector2d middle(x + 0.5, y + 0.5);
        if (side(a, b, middle) >= 0 && side(b, c, middle) >= 0 && side(c, a, middle) >= 0)
          colours[static_cast<std::size_t>(y * kSide + x)] = colour;
      }
  }
  std::string text = "<g stroke-width=\"1\" fill=\"none\" shape-rendering=\"crispEdges\">\n";
  for (int y = 0; y < kSide; ++y)
    for (int x = 0, end = 0; x < kSide; x = end) {
      const auto at = [&](int column) -> const std::string& {
        return colours[static_cast<std::size_t>(y * kSide + column)];
      };
      for (end = x + 1; end < kSide && at(end) == at(x);) ++end;
      if (!at(x).empty()) text += fmt::format("<path stroke=\"{}\" d=\"M{} {}.5H{}\"/>\n", at(x), x, y, end);
    }
  return text + "</g>\n";
}

std::string picture(const Painted& painted, const View& view) {
  const std::vector<Facing> triangles = facing(painted, view);
  return fmt::format("<svg width=\"{0}\" height=\"{0}\" viewBox=\"0 0 {0} {0}\">\n{1}</svg>\n", kSide,
                     triangles.size() > kMostPolygons ? pixels(triangles) : polygons(triangles));
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
  const std::vector<std::pair<std::string, Painted>> columns{
      {"object at rest", of_one_colour(rest, kRest)},
      {"pose on the object", of_one_colour(pose.transferred, kTransferred)},
      {"pose as given", of_one_colour(pose.given, kGiven)},
      {fmt::format("on the object: up to {:.1f} % from the given", 100 * there.maxCoeff() / size),
       by_distance(pose.transferred, there, kFarthest * size)},
      {fmt::format("given: up to {:.1f} % from that on the object", 100 * back.maxCoeff() / size),
       by_distance(pose.given, back, kFarthest * size)}};
  const AlignmentOutcome& outcome = pose.outcome;
  std::string text = fmt::format(
      "<section class=\"{0}\">\n<h2>{1} <span>{0}</span></h2>\n<p><b>{2}.</b></p>\n"
      "<p>{3}, doubt {4:.2f}, residual {5:.1f} % of the body's size, {6:.1f} % of the volume inside out, {7:.0f} % "
      "lost by "
      "the eigenfunctions</p>\n<table>\n<tr>",
      name_of(outcome.verdict), escaped(outcome.name), escaped(what_to_change(outcome)), escaped(outcome.method),
      outcome.doubt, 100 * outcome.residual, 100 * outcome.inverted_fraction, 100 * outcome.shape_space_error);
  for (const auto& [label, painted] : columns) text += fmt::format("<th>{}</th>", label);
  text += "</tr>\n";
  for (const View& view : views_of(rest, {&rest, &pose.transferred, &pose.given})) {
    text += "<tr>\n";
    for (const auto& [label, painted] : columns) text += "<td>" + picture(painted, view) + "</td>\n";
    text += "</tr>\n";
  }
  return text + "</table>\n</section>\n";
}

}  // namespace

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
  std::string text = fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<title>{0}: alignment</title>\n<style>\n"
      "body {{ font-family: sans-serif; margin: 1.5em; }}\n"
      "section {{ border-left: 6px solid #4a4; padding-left: 1em; margin-bottom: 2em; }}\n"
      "section.doubtful {{ border-color: #e90; }} section.refused {{ border-color: #c00; }}\n"
      "h2 span {{ font-size: 60%; font-weight: normal; }} th {{ font-weight: normal; font-size: 85%; }}\n"
      ".scale {{ display: inline-block; width: 16em; height: 0.8em; vertical-align: middle;\n"
      "  background: linear-gradient(to right, {1}, {2}); }}\n</style>\n</head>\n<body>\n<h1>{0}: alignment of the "
      "examples</h1>\n<p>Distance of the surfaces: 0 <span class=\"scale\"></span> {3:.0f} % of the body's size and "
      "more. The last picture of a row shows what the pose has and the object lacks, such as a limb.</p>\n",
      escaped(title), hex(kNear), hex(kFar), 100 * kFarthest);
  for (const ReportedPose& pose : poses) text += section(rest, pose);
  return text + "</body>\n</html>\n";
}

}  // namespace exmat::precompute
