#include "precompute/posing/surface_springs.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "common/core/decompositions.h"
#include "common/mesh/farthest_points.h"
#include "precompute/alignment/kd_tree.h"

namespace exmat::precompute {
namespace {

// Vertices of the surface that stand for all of them, and of these the nearest that a vertex of the cage goes with.
constexpr Eigen::Index kStart = 1500, kNeighbours = 24;

}  // namespace

Eigen::VectorXd vertex_shares(const SurfaceMesh& surface) {
  Eigen::VectorXd shares = Eigen::VectorXd::Zero(surface.vertices.rows());
  for (const auto& corners : surface.triangles.rowwise()) {
    const Eigen::RowVector3d a = surface.vertices.row(corners[0]), b = surface.vertices.row(corners[1]),
                             c = surface.vertices.row(corners[2]);
    const double area = (b - a).cross(c - a).norm();
    for (const std::int32_t corner : corners) shares[corner] += area;
  }
  return shares / shares.sum();
}

SurfaceSprings::SurfaceSprings(const TetMesh& cage, const SurfaceMesh& surface, const Embedding& embedding,
                               const VertexArray& places)
    : interpolation_(embedding.points.interpolation(cage)), shares_(vertex_shares(surface)), places_(places) {
  const Eigen::SparseMatrix<double, Eigen::RowMajor> scalar =
      interpolation_.transpose() * shares_.asDiagonal() * interpolation_;
  std::vector<Eigen::Triplet<double>> entries;
  for (Eigen::Index row = 0; row < scalar.rows(); ++row)
    for (Eigen::SparseMatrix<double, Eigen::RowMajor>::InnerIterator at(scalar, row); at; ++at)
      for (Eigen::Index axis = 0; axis < 3; ++axis)
        entries.emplace_back(3 * at.row() + axis, 3 * at.col() + axis, at.value());
  hessian_.resize(3 * scalar.rows(), 3 * scalar.cols());
  hessian_.setFromTriplets(entries.begin(), entries.end());
}

double SurfaceSprings::energy(const VertexArray& x) const {
  const VertexArray missed = interpolation_ * x - places_;
  return missed.rowwise().squaredNorm().dot(shares_) / 2;
}

VertexArray SurfaceSprings::gradient(const VertexArray& x) const {
  const VertexArray missed = interpolation_ * x - places_;
  return interpolation_.transpose() * (shares_.asDiagonal() * missed);
}

double SurfaceSprings::farthest(const VertexArray& x, Eigen::Index& worst) const {
  const VertexArray missed = interpolation_ * x - places_;
  const Eigen::ArrayXd counted = (shares_.array() > 0).cast<double>();
  return (missed.rowwise().norm().array() * counted).maxCoeff(&worst);
}

VertexArray rigid_start(const TetMesh& cage, const SurfaceMesh& surface, const VertexArray& posed) {
  const std::vector<Eigen::Index> chosen = farthest_points(surface.vertices, kStart);
  const VertexArray from = surface.vertices(chosen, Eigen::all), to = posed(chosen, Eigen::all);
  const KdTree tree(from);
  VertexArray start(cage.vertex_count(), 3);
  for (Eigen::Index v = 0; v < cage.vertex_count(); ++v) {
    const Eigen::RowVector3d x = cage.vertices.row(v);
    const std::vector<std::int32_t> near = tree.nearest(x.data(), kNeighbours);
    const VertexArray here = from(near, Eigen::all), there = to(near, Eigen::all);
    // The radius that the farthest of them has keeps weights finite where one lies on the vertex.
    const Eigen::ArrayXd squares = (here.rowwise() - x).rowwise().squaredNorm().array();
    const Eigen::VectorXd weights = (squares + 0.01 * squares.maxCoeff()).square().inverse();
    const Eigen::RowVector3d centre = weights.transpose() * here / weights.sum(),
                             posed_centre = weights.transpose() * there / weights.sum();
    const Eigen::Matrix3d moment =
        (here.rowwise() - centre).transpose() * weights.asDiagonal() * (there.rowwise() - posed_centre);
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(moment, Eigen::ComputeFullU | Eigen::ComputeFullV);
    Eigen::Vector3d signs(1, 1, (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1);
    const Eigen::Matrix3d rotation = svd.matrixV() * signs.asDiagonal() * svd.matrixU().transpose();
    start.row(v) = posed_centre + (x - centre) * rotation.transpose();
  }
  return start;
}

}  // namespace exmat::precompute
