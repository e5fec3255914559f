#include "common/mesh/geometry.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <map>
#include <vector>

namespace exmat {
namespace {

// Faces opposite to each vertex, outward for a tet of positive volume.
constexpr std::array<std::array<int, 3>, 4> kFaces{{{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}}};

}  // namespace

Eigen::Matrix<double, 4, 3> tet_positions(const TetMesh& mesh, Eigen::Index tet) {
  Eigen::Matrix<double, 4, 3> positions;
  for (int corner = 0; corner < 4; ++corner) positions.row(corner) = mesh.vertices.row(mesh.tets(tet, corner));
  return positions;
}

Eigen::VectorXd tet_volumes(const TetMesh& mesh) {
  Eigen::VectorXd volumes(mesh.tet_count());
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t) {
    const auto x = tet_positions(mesh, t);
    const Eigen::Matrix3d edges = x.bottomRows<3>().rowwise() - x.row(0);
    volumes[t] = edges.determinant() / 6.0;
  }
  return volumes;
}

Eigen::Matrix<double, 4, 3> shape_gradients(const Eigen::Matrix<double, 4, 3>& positions) {
  const Eigen::Matrix3d edges = positions.bottomRows<3>().rowwise() - positions.row(0);
  Eigen::Matrix<double, 4, 3> gradients;
  gradients.bottomRows<3>() = edges.inverse().transpose();
  gradients.row(0) = -gradients.bottomRows<3>().colwise().sum();
  return gradients;
}

Eigen::Vector4d barycentric(const Eigen::Matrix<double, 4, 3>& corners, const Eigen::Vector3d& point) {
  const Eigen::Vector3d middle = corners.colwise().mean();
  return (shape_gradients(corners) * (point - middle)).array() + 0.25;  // linear from the middle, where all are 1/4
}

Eigen::Vector3d centroid(const TetMesh& mesh) {
  const Eigen::VectorXd volumes = tet_volumes(mesh);
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t)
    sum += volumes[t] * tet_positions(mesh, t).colwise().mean().transpose();
  return sum / volumes.sum();
}

double bounding_box_diagonal(const VertexArray& vertices) {
  return (vertices.colwise().maxCoeff() - vertices.colwise().minCoeff()).norm();
}

Eigen::Vector3d origin_near(const Eigen::Vector3d& place, double size) {
  constexpr double kRounding = 0x1p-24, kMostOfSize = 1e-5;
  if (!(place.cwiseAbs().maxCoeff() * kRounding > kMostOfSize * size)) return Eigen::Vector3d::Zero();
  return place.array().round();
}

Eigen::Vector3d origin_near(const VertexArray& vertices) {
  const Eigen::RowVector3d middle = 0.5 * (vertices.colwise().minCoeff() + vertices.colwise().maxCoeff());
  return origin_near(middle.transpose(), bounding_box_diagonal(vertices));
}

double longest_box_edge(const VertexArray& vertices) {
  return (vertices.colwise().maxCoeff() - vertices.colwise().minCoeff()).maxCoeff();
}

Eigen::VectorXd region_tet_shares(const TetMesh& mesh, const FlagVector& inside, const Eigen::VectorXd& window) {
  Eigen::VectorXd shares = Eigen::VectorXd::Zero(mesh.tet_count());
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t)
    if (inside(mesh.tets.row(t).transpose()).all()) shares[t] = window(mesh.tets.row(t).transpose()).mean();
  return shares;
}

TriangleArray surface_triangles(const TetArray& tets) {
  struct Face {
    std::array<std::int32_t, 3> corners;
    int count;
    Eigen::Index order;
  };
  std::map<std::array<std::int32_t, 3>, Face> faces;
  for (Eigen::Index t = 0; t < tets.rows(); ++t) {
    for (int f = 0; f < 4; ++f) {
      std::array<std::int32_t, 3> corners{};
      for (int k = 0; k < 3; ++k) corners[k] = tets(t, kFaces[f][k]);
      auto key = corners;
      std::sort(key.begin(), key.end());
      const auto [entry, inserted] = faces.try_emplace(key, Face{corners, 0, 4 * t + f});
      ++entry->second.count;
    }
  }
  std::vector<const Face*> boundary;
  for (const auto& [key, face] : faces)
    if (face.count == 1) boundary.push_back(&face);
  std::sort(boundary.begin(), boundary.end(), [](const Face* a, const Face* b) { return a->order < b->order; });
  TriangleArray triangles(static_cast<Eigen::Index>(boundary.size()), 3);
  for (std::size_t i = 0; i < boundary.size(); ++i)
    for (int k = 0; k < 3; ++k) triangles(static_cast<Eigen::Index>(i), k) = boundary[i]->corners[k];
  return triangles;
}

}  // namespace exmat
