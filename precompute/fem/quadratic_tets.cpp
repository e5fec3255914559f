#include "precompute/fem/quadratic_tets.h"

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "common/elastic/material.h"
#include "common/mesh/geometry.h"

namespace exmat::precompute {
namespace {

constexpr int kNodes = 10;
constexpr std::array<std::array<int, 2>, 6> kEdges{{{0, 1}, {1, 2}, {2, 0}, {0, 3}, {1, 3}, {2, 3}}};

using Nodes = Eigen::Matrix<std::int32_t, kNodes, 1>;
using Gradients = Eigen::Matrix<double, kNodes, 3>;
using Edge = std::pair<std::int32_t, std::int32_t>;

Edge edge_of(const TetMesh& mesh, Eigen::Index tet, int edge) {
  return std::minmax(mesh.tets(tet, kEdges[static_cast<std::size_t>(edge)][0]),
                     mesh.tets(tet, kEdges[static_cast<std::size_t>(edge)][1]));
}

std::vector<Edge> edges_of(const TetMesh& mesh) {
  std::vector<Edge> edges;
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t)
    for (int e = 0; e < 6; ++e) edges.push_back(edge_of(mesh, t, e));
  std::ranges::sort(edges);
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  return edges;
}

Nodes nodes_of(const TetMesh& mesh, const std::vector<Edge>& edges, Eigen::Index tet) {
  Nodes nodes;
  nodes.head<4>() = mesh.tets.row(tet).transpose();
  for (int e = 0; e < 6; ++e)
    nodes[4 + e] = static_cast<std::int32_t>(mesh.vertex_count() +
                                             (std::ranges::lower_bound(edges, edge_of(mesh, tet, e)) - edges.begin()));
  return nodes;
}

// Gradients of the shape functions L (2 L - 1) of vertices and 4 L_i L_j of edges, at barycentric coordinates L.
Gradients gradients_at(const Eigen::Matrix<double, 4, 3>& linear, const Eigen::Vector4d& L) {
  Gradients gradients;
  for (int i = 0; i < 4; ++i) gradients.row(i) = (4 * L[i] - 1) * linear.row(i);
  for (int e = 0; e < 6; ++e) {
    const auto [i, j] = kEdges[static_cast<std::size_t>(e)];
    gradients.row(4 + e) = 4 * (L[i] * linear.row(j) + L[j] * linear.row(i));
  }
  return gradients;
}

// 420 over the volume times the integrals of products of shape functions.
Eigen::Matrix<double, kNodes, kNodes> mass_integers() {
  Eigen::Matrix<double, kNodes, kNodes> M;
  const auto touches = [](std::size_t e, int vertex) { return kEdges[e][0] == vertex || kEdges[e][1] == vertex; };
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j < 4; ++j) M(i, j) = i == j ? 6 : 1;
  for (std::size_t e = 0; e < 6; ++e) {
    const auto row = static_cast<Eigen::Index>(4 + e);
    for (int i = 0; i < 4; ++i) M(row, i) = M(i, row) = touches(e, i) ? -4 : -6;
    for (std::size_t f = 0; f < 6; ++f) {
      const bool share = touches(e, kEdges[f][0]) || touches(e, kEdges[f][1]);
      M(row, static_cast<Eigen::Index>(4 + f)) = e == f ? 32 : share ? 16 : 8;
    }
  }
  return M;
}

}  // namespace

QuadraticTets quadratic_tets(const TetMesh& mesh, const TetMaterials& materials, const FlagVector& fixed) {
  constexpr double kNear = 0.58541019662496852, kFar = 0.1381966011250105;  // barycentric, of the Gauss points
  const std::vector<Edge> edges = edges_of(mesh);
  const auto n = mesh.vertex_count(), count = n + std::ssize(edges);
  QuadraticTets result;
  result.nodes.resize(count, 3);
  result.nodes.topRows(n) = mesh.vertices;
  FlagVector node_fixed = FlagVector::Zero(count);
  node_fixed.head(n) = fixed;
  for (std::size_t e = 0; e < edges.size(); ++e) {
    const auto [i, j] = edges[e];
    const auto row = n + static_cast<Eigen::Index>(e);
    result.nodes.row(row) = 0.5 * (mesh.vertices.row(i) + mesh.vertices.row(j));
    node_fixed[row] = fixed[i] != 0 && fixed[j] != 0 ? 1 : 0;
  }
  const Eigen::VectorXd volumes = tet_volumes(mesh);
  const Eigen::Matrix<double, kNodes, kNodes> unit_mass = mass_integers() / 420;
  std::vector<Eigen::Triplet<double>> mass, stiffness;
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t) {
    const Nodes nodes = nodes_of(mesh, edges, t);
    const LameParameters lame = lame_parameters(materials.youngs_modulus[t], materials.poisson_ratio[t]);
    const Eigen::Matrix<double, 4, 3> linear = shape_gradients(tet_positions(mesh, t));
    const Gradients centre = gradients_at(linear, Eigen::Vector4d::Constant(0.25));
    std::array<Gradients, 4> gauss;
    for (int g = 0; g < 4; ++g) {
      Eigen::Vector4d L = Eigen::Vector4d::Constant(kFar);
      L[g] = kNear;
      gauss[static_cast<std::size_t>(g)] = gradients_at(linear, L);
    }
    for (int i = 0; i < kNodes; ++i)
      for (int j = 0; j < kNodes; ++j) {
        Eigen::Matrix3d block = lame.lambda * centre.row(i).transpose() * centre.row(j);
        for (const Gradients& at : gauss)
          block += 0.25 * lame.mu *
                   (at.row(j).transpose() * at.row(i) + at.row(i).dot(at.row(j)) * Eigen::Matrix3d::Identity());
        block *= volumes[t];
        mass.emplace_back(nodes[i], nodes[j], materials.density[t] * volumes[t] * unit_mass(i, j));
        for (int a = 0; a < 3; ++a)
          for (int b = 0; b < 3; ++b) stiffness.emplace_back(3 * nodes[i] + a, 3 * nodes[j] + b, block(a, b));
      }
  }
  SparseMatrix scalar(count, count), full(3 * count, 3 * count);
  scalar.setFromTriplets(mass.begin(), mass.end());
  full.setFromTriplets(stiffness.begin(), stiffness.end());
  result.system = eliminate_fixed(result.nodes, expand_to_vectors(scalar), full, node_fixed);
  return result;
}

}  // namespace exmat::precompute
