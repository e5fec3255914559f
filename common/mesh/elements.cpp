#include "common/mesh/elements.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "common/mesh/geometry.h"

namespace exmat {
namespace {

using Gradients = Eigen::Matrix<double, 4, 3>;

Gradients gradients_of_tet(const TetMesh& mesh, Eigen::Index tet) { return shape_gradients(tet_positions(mesh, tet)); }

Elements linear_elements(const TetMesh& mesh, const TetMaterials& materials) {
  Elements elements;
  elements.vertices = corners_of(mesh);
  elements.gradients.resize(4 * mesh.tet_count(), 3);
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t) {
    elements.tets.indices.push_back(static_cast<std::int32_t>(t));
    elements.tets.close();
    elements.gradients.middleRows<4>(4 * t) = gradients_of_tet(mesh, t);
  }
  elements.volumes = tet_volumes(mesh);
  elements.youngs_modulus = materials.youngs_modulus;
  elements.poisson_ratio = materials.poisson_ratio;
  return elements;
}

// The tets around a vertex that are of one material, the materials in the order of their first tets.
std::vector<std::vector<std::int32_t>> by_material(std::span<const std::int32_t> tets, const TetMaterials& materials) {
  std::vector<std::vector<std::int32_t>> groups;
  for (const std::int32_t t : tets) {
    const auto same = std::ranges::find_if(groups, [&](const std::vector<std::int32_t>& group) {
      return materials.youngs_modulus[group.front()] == materials.youngs_modulus[t] &&
             materials.poisson_ratio[group.front()] == materials.poisson_ratio[t];
    });
    if (same == groups.end())
      groups.push_back({t});
    else
      same->push_back(t);
  }
  return groups;
}

Elements smoothed_elements(const TetMesh& mesh, const TetMaterials& materials) {
  const IndexLists around = lists_around(static_cast<std::int32_t>(mesh.vertex_count()), corners_of(mesh));
  const Eigen::VectorXd tet_volume = tet_volumes(mesh);
  Elements elements;
  std::vector<double> volumes;
  std::vector<std::int32_t> centres;
  std::vector<Eigen::RowVector3d> gradients;
  for (std::size_t v = 0; v < around.size(); ++v)
    for (const std::vector<std::int32_t>& tets : by_material(around[v], materials)) {
      double volume = 0;
      std::vector<std::int32_t> vertices;
      for (const std::int32_t t : tets) {
        volume += tet_volume[t] / 4;
        for (const auto vertex : mesh.tets.row(t)) vertices.push_back(vertex);
      }
      std::ranges::sort(vertices);
      vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
      const std::size_t first = gradients.size();
      gradients.resize(first + vertices.size(), Eigen::RowVector3d::Zero());
      for (const std::int32_t t : tets) {
        const Gradients own = tet_volume[t] / 4 / volume * gradients_of_tet(mesh, t);
        for (int c = 0; c < 4; ++c) {
          const auto place = std::ranges::lower_bound(vertices, mesh.tets(t, c)) - vertices.begin();
          gradients[first + static_cast<std::size_t>(place)] += own.row(c);
        }
      }
      elements.vertices.indices.insert(elements.vertices.indices.end(), vertices.begin(), vertices.end());
      elements.vertices.close();
      elements.tets.indices.insert(elements.tets.indices.end(), tets.begin(), tets.end());
      elements.tets.close();
      centres.push_back(static_cast<std::int32_t>(v));
      volumes.push_back(volume);
    }
  const auto count = std::ssize(volumes);
  elements.gradients.resize(std::ssize(gradients), 3);
  for (std::size_t i = 0; i < gradients.size(); ++i)
    elements.gradients.row(static_cast<Eigen::Index>(i)) = gradients[i];
  elements.centres = Eigen::Map<const IndexVector>(centres.data(), count);
  elements.volumes = Eigen::Map<const Eigen::VectorXd>(volumes.data(), count);
  elements.youngs_modulus.resize(count);
  elements.poisson_ratio.resize(count);
  for (Eigen::Index e = 0; e < count; ++e) {
    elements.youngs_modulus[e] = materials.youngs_modulus[elements.tets_of(e).front()];
    elements.poisson_ratio[e] = materials.poisson_ratio[elements.tets_of(e).front()];
  }
  return elements;
}

}  // namespace

IndexLists corners_of(const TetMesh& mesh) {
  IndexLists corners;
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t) {
    for (const auto vertex : mesh.tets.row(t)) corners.indices.push_back(vertex);
    corners.close();
  }
  return corners;
}

IndexLists lists_around(std::int32_t count, const IndexLists& lists) {
  IndexLists around{std::vector<std::int32_t>(static_cast<std::size_t>(count) + 1), {}};
  for (const std::int32_t index : lists.indices) ++around.starts[static_cast<std::size_t>(index) + 1];
  std::partial_sum(around.starts.begin(), around.starts.end(), around.starts.begin());
  around.indices.resize(lists.indices.size());
  std::vector<std::int32_t> next(around.starts);
  for (std::size_t list = 0; list < lists.size(); ++list)
    for (const std::int32_t index : lists[list])
      around.indices[static_cast<std::size_t>(next[static_cast<std::size_t>(index)]++)] =
          static_cast<std::int32_t>(list);
  return around;
}

Elements elements_of(const TetMesh& mesh, const TetMaterials& materials) {
  return materials.formulation == Formulation::kSmoothed ? smoothed_elements(mesh, materials)
                                                         : linear_elements(mesh, materials);
}

Eigen::VectorXd mean_over_elements(const TetMesh& mesh, const Elements& elements, const Eigen::VectorXd& values) {
  if (!elements.smoothed()) return values;
  const Eigen::VectorXd volumes = tet_volumes(mesh);
  Eigen::VectorXd means(elements.count());
  for (Eigen::Index e = 0; e < elements.count(); ++e) {
    double sum = 0, volume = 0;
    for (const std::int32_t t : elements.tets_of(e)) {
      sum += volumes[t] * values[t];
      volume += volumes[t];
    }
    means[e] = sum / volume;
  }
  return means;
}

Eigen::SparseMatrix<double, Eigen::RowMajor> variance_matrix(const TetMesh& mesh, const TetMaterials& materials,
                                                             const Elements& elements) {
  Eigen::SparseMatrix<double, Eigen::RowMajor> matrix(mesh.vertex_count(), mesh.vertex_count());
  if (!elements.smoothed()) return matrix;
  const Eigen::VectorXd volumes = tet_volumes(mesh);
  std::vector<Eigen::Triplet<double>> entries;
  for (Eigen::Index e = 0; e < elements.count(); ++e) {
    const auto vertices = elements.vertices_of(e);
    const auto mean = elements.gradients_of(e);
    // Each tet counts by its difference from the mean, so that affine displacements have none but for rounding.
    Eigen::MatrixXd ring = Eigen::MatrixXd::Zero(std::ssize(vertices), std::ssize(vertices));
    for (const std::int32_t t : elements.tets_of(e)) {
      Eigen::MatrixX3d difference = -mean;
      const Gradients own = gradients_of_tet(mesh, t);
      for (int c = 0; c < 4; ++c)
        difference.row(std::ranges::lower_bound(vertices, mesh.tets(t, c)) - vertices.begin()) += own.row(c);
      ring += volumes[t] / 4 * difference * difference.transpose();
    }
    ring *= materials.variance_factor * elements.lame(e).mu;
    for (Eigen::Index i = 0; i < ring.rows(); ++i)
      for (Eigen::Index j = 0; j < ring.cols(); ++j)
        entries.emplace_back(vertices[static_cast<std::size_t>(i)], vertices[static_cast<std::size_t>(j)], ring(i, j));
  }
  matrix.setFromTriplets(entries.begin(), entries.end());
  return matrix;
}

}  // namespace exmat
