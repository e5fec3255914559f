#include "precompute/inputs/object_skeleton.h"

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <fmt/format.h>
#include <limits>

#include "common/core/error.h"
#include "common/core/log.h"
#include "common/mesh/assembly.h"
#include "common/mesh/geometry.h"

namespace exmat::precompute {
namespace {

constexpr double kHold = 1e3;        // of given weights beside the field's own stiffness, over an edge's length
constexpr Eigen::Index kFewest = 4;  // vertices that hold a bone: three would leave it a turn
constexpr double kOnLine = 1e-6;     // distance from a line over the length there, of points that are on it

Eigen::VectorXd vertex_areas(const SurfaceMesh& surface) {
  const TriangleSamples samples = triangle_samples(surface.vertices, surface.triangles);
  Eigen::VectorXd areas = Eigen::VectorXd::Zero(surface.vertices.rows());
  for (Eigen::Index t = 0; t < surface.triangles.rows(); ++t)
    for (int corner = 0; corner < 3; ++corner) areas[surface.triangles(t, corner)] += samples.areas[t] / 3;
  return areas;
}

double distance_to_segment(const Eigen::Vector3d& point, const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  const Eigen::Vector3d way = to - from;
  const double share = way.squaredNorm() > 0 ? std::clamp((point - from).dot(way) / way.squaredNorm(), 0.0, 1.0) : 0;
  return (point - from - share * way).norm();
}

// Ends of the axes of bones: the joints that hang on them, or as far beyond the middle of what hangs on a last one.
std::vector<std::vector<Eigen::Vector3d>> axis_ends(const SkeletonData& skeleton, const VertexArray& vertices) {
  const auto joint = [&](Eigen::Index b) -> Eigen::Vector3d { return skeleton.bind.block<3, 1>(3 * b, 3); };
  std::vector<std::vector<Eigen::Vector3d>> ends(skeleton.bones.size());
  for (Eigen::Index b = 0; b < skeleton.parents.size(); ++b)
    if (skeleton.parents[b] >= 0) ends[static_cast<std::size_t>(skeleton.parents[b])].push_back(joint(b));
  for (Eigen::Index b = 0; b < skeleton.parents.size(); ++b) {
    auto& own = ends[static_cast<std::size_t>(b)];
    const Eigen::VectorXd weights = skeleton.weights.col(b).array().square();
    if (!own.empty() || weights.sum() == 0) continue;
    const Eigen::Vector3d middle = vertices.transpose() * weights / weights.sum();
    own.push_back(joint(b) + 1.5 * (middle - joint(b)));
  }
  return ends;
}

// Estimate of the length of an edge [m].
double edge_length_estimate(const TetMesh& mesh) {
  return bounding_box_diagonal(mesh.vertices) / std::cbrt(static_cast<double>(mesh.vertex_count()));
}

// Weights at the vertices [n x b] of least Dirichlet energy. Points that the matrix `at` [k x n] interpolates hold them
// at `given` [k x b], by the area of each [m^2].
RowMatrix spread_weights(const TetMesh& mesh, const Eigen::SparseMatrix<double>& at, const Eigen::VectorXd& areas,
                         const RowMatrix& given) {
  const Eigen::VectorXd hold = kHold / edge_length_estimate(mesh) * areas;
  const Eigen::SparseMatrix<double> matrix = Eigen::SparseMatrix<double>(laplacian_stiffness(mesh)) +
                                             Eigen::SparseMatrix<double>(at.transpose() * hold.asDiagonal() * at);
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factor(matrix);
  if (factor.info() != Eigen::Success)
    throw WorkError(
        "the weights of bones cannot be spread over the tets: parts of the mesh are connected to no vertex that has "
        "weights");
  RowMatrix weights = factor.solve(Eigen::MatrixXd(at.transpose() * (hold.asDiagonal() * given)));
  for (auto row : weights.rowwise()) {
    const double least = row.maxCoeff() < kLeastWeight ? 0 : kLeastWeight;  // each of very many bones may have less
    row = (row.array() < least).select(0, row).eval();
    row /= row.sum();
  }
  return weights;
}

// A vertex that a bone may hold. The first in order is held first.
struct OwnVertex {
  double depth;    // distance from the axis over the sum of that and the distance from the surface
  double to_axis;  // distance from the axis [m]
  Eigen::Index vertex;
  auto operator<=>(const OwnVertex&) const = default;
};

// True if the vertices lie on a line, about which what they hold may turn.
bool are_on_a_line(const VertexArray& vertices) {
  const VertexArray from_first = vertices.rowwise() - vertices.row(0);
  Eigen::Index farthest = 0;
  const double length = from_first.rowwise().norm().maxCoeff(&farthest);
  const Eigen::Vector3d line = from_first.row(farthest);
  for (const Eigen::Vector3d way : from_first.rowwise())
    if (line.cross(way).norm() > kOnLine * length * length) return false;
  return true;
}

}  // namespace

SkeletonData skeleton_of_cage(const ObjectSurface& surface) {
  SkeletonData skeleton = *surface.file().skeleton;
  const TetMesh& cage = surface.cage().mesh;
  skeleton.weights = spread_weights(cage, surface.embedding().points.interpolation(cage),
                                    vertex_areas(surface.file().mesh), skeleton.weights);
  return skeleton;
}

void fill_weights(const TetMesh& mesh, RowMatrix& weights) {
  const Eigen::VectorXd given = (weights.rowwise().sum().array() > 0).cast<double>();
  if (given.all()) return;
  Eigen::SparseMatrix<double> at(given.size(), given.size());
  at.setIdentity();
  const double edge = edge_length_estimate(mesh);
  const RowMatrix spread = spread_weights(mesh, at, edge * edge * given, weights);
  for (Eigen::Index v = 0; v < given.size(); ++v)
    if (given[v] == 0) weights.row(v) = spread.row(v);
}

FlagVector pin_to_bones(const VertexArray& vertices, const SurfaceTree& surface, SkeletonData& skeleton,
                        std::vector<std::string>& warnings) {
  const auto ends = axis_ends(skeleton, vertices);
  const double on_axis = kOnLine * bounding_box_diagonal(vertices);
  std::vector<std::vector<OwnVertex>> own(skeleton.bones.size());
  for (Eigen::Index v = 0; v < vertices.rows(); ++v) {
    Eigen::Index bone = 0;
    if (skeleton.weights.row(v).maxCoeff(&bone) < kOwnWeight) continue;
    const Eigen::Vector3d point = vertices.row(v);
    const Eigen::Vector3d joint = skeleton.bind.block<3, 1>(3 * bone, 3);
    double to_axis = (point - joint).norm();
    for (const Eigen::Vector3d& end : ends[static_cast<std::size_t>(bone)])
      to_axis = std::min(to_axis, distance_to_segment(point, joint, end));
    const double to_surface = (surface.nearest(point).position - point).norm();
    own[static_cast<std::size_t>(bone)].push_back(
        {to_axis > on_axis ? to_axis / (to_axis + to_surface) : 0, to_axis, v});
  }
  FlagVector pinned = FlagVector::Zero(vertices.rows());
  std::string none;
  for (std::size_t b = 0; b < own.size(); ++b) {
    std::ranges::sort(own[b]);
    std::vector<Eigen::Index> held;
    for (const auto [depth, to_axis, vertex] : own[b]) {
      if (depth > kDepth && std::ssize(held) >= kFewest && !are_on_a_line(vertices(held, Eigen::all))) break;
      held.push_back(vertex);
      pinned[vertex] = 1;
      skeleton.weights.row(vertex).setZero();
      skeleton.weights(vertex, static_cast<Eigen::Index>(b)) = 1;
    }
    if (own[b].empty()) none += fmt::format("{}\"{}\"", none.empty() ? "" : ", ", skeleton.bones[b]);
  }
  log::info(fmt::format("skeleton: {} bones hold {} of {} vertices", skeleton.bones.size(), pinned.cast<int>().sum(),
                        vertices.rows()));
  if (!none.empty()) {
    warnings.push_back(
        fmt::format("no vertex of the tets hangs on one of these bones alone, and they move only the "
                    "flesh about them by their weights: {}; more tets would find some",
                    none));
    log::warning(warnings.back());
  }
  return pinned;
}

SkeletonData clamp_bone(const TetMesh& mesh, const FlagVector& fixed) {
  SkeletonData skeleton;
  skeleton.bones = {"clamp"};
  skeleton.parents = IndexVector::Constant(1, -1);
  skeleton.bind = RowMatrix::Identity(3, 4);
  skeleton.bind.col(3) = mesh.vertices.transpose() * fixed.cast<double>() / fixed.cast<double>().sum();
  skeleton.weights = RowMatrix::Ones(mesh.vertex_count(), 1);
  skeleton.first_frames = IndexVector::Zero(1);
  skeleton.poses.resize(0, 7);
  return skeleton;
}

}  // namespace exmat::precompute
