#include "precompute/full_space/mesh_elasticity.h"

#include <Eigen/LU>
#include <algorithm>

#include "common/elastic/materials.h"
#include "common/mesh/assembly.h"

namespace exmat::precompute {

MeshElasticity::MeshElasticity(const TetMesh& mesh, const TetMaterials& materials,
                               const std::vector<std::int32_t>& free_dofs)
    : size_(std::ssize(free_dofs)),
      mesh_(mesh),
      materials_(materials),
      elements_(elements_of(mesh, materials)),
      unknowns_(static_cast<std::size_t>(mesh.vertex_count()), -1),
      gradients_(elements_.gradients),
      rest_volumes_(elements_.volumes),
      volumes_(elements_.volumes) {
  for (std::size_t i = 0; i < free_dofs.size(); i += 3)
    unknowns_[static_cast<std::size_t>(free_dofs[i] / 3)] = static_cast<std::int32_t>(i);
  build_pattern();
  build_variance();
}

void MeshElasticity::build_pattern() {
  std::vector<std::vector<std::int32_t>> rows(static_cast<std::size_t>(size_ / 3));  // of each free vertex, from it on
  const auto for_pairs = [&](Eigen::Index element, auto&& work) {
    const auto vertices = elements_.vertices_of(element);
    for (const std::int32_t i : vertices)
      for (const std::int32_t j : vertices) {
        const std::int32_t row = unknowns_[static_cast<std::size_t>(i)],
                           column = unknowns_[static_cast<std::size_t>(j)];
        if (column >= 0 && row >= column) work(row, column);
      }
  };
  for (Eigen::Index e = 0; e < elements_.count(); ++e)
    for_pairs(
        e, [&](std::int32_t row, std::int32_t column) { rows[static_cast<std::size_t>(column / 3)].push_back(row); });
  pattern_.resize(size_, size_);
  std::size_t entries = 0;
  for (std::vector<std::int32_t>& own : rows) {
    std::ranges::sort(own);
    own.erase(std::unique(own.begin(), own.end()), own.end());
    entries += 9 * own.size() - 3;
  }
  pattern_.resizeNonZeros(static_cast<Eigen::Index>(entries));
  std::int32_t at = 0;
  for (Eigen::Index column = 0; column < size_; ++column) {
    pattern_.outerIndexPtr()[column] = at;
    for (const std::int32_t row : rows[static_cast<std::size_t>(column / 3)])
      for (std::int32_t axis = 0; axis < 3; ++axis)
        if (row + axis >= column) pattern_.innerIndexPtr()[at++] = row + axis;
  }
  pattern_.outerIndexPtr()[size_] = at;
  pattern_.coeffs().setZero();
  for (Eigen::Index e = 0; e < elements_.count(); ++e) {
    starts_.push_back(slots_.size());
    for_pairs(e, [&](std::int32_t row, std::int32_t column) {
      const auto& own = rows[static_cast<std::size_t>(column / 3)];
      const auto place = std::ranges::lower_bound(own, row) - own.begin();
      slots_.push_back(pattern_.outerIndexPtr()[column] + 3 * static_cast<std::int32_t>(place));
    });
  }
}

void MeshElasticity::build_variance() {
  has_variance_ = elements_.smoothed();
  if (!has_variance_) return;
  std::vector<std::int32_t> free_vertices;
  for (std::size_t v = 0; v < unknowns_.size(); ++v)
    if (unknowns_[v] >= 0) free_vertices.push_back(static_cast<std::int32_t>(v));
  variance_ = submatrix(variance_matrix(mesh_, materials_, elements_), free_vertices);
  variance_values_ = values_of(expand_to_vectors(variance_));
}

Eigen::Index MeshElasticity::set_undeformed(const VertexArray& positions) {
  has_variance_ = false;
  Eigen::Index left_out = 0;
  const Eigen::VectorXd moved = (positions - mesh_.vertices).reshaped<Eigen::RowMajor>();
  for (Eigen::Index e = 0; e < elements_.count(); ++e) {
    const auto shape = elements_.gradients_of(e);
    const Eigen::Matrix3d F = Eigen::Matrix3d::Identity() + elements_.displacement_gradient(e, moved);
    const double determinant = F.determinant();
    volumes_[e] = std::max(0.0, rest_volumes_[e] * determinant);
    if (determinant > 0)
      gradients_.middleRows(elements_.vertices.starts[static_cast<std::size_t>(e)], shape.rows()) = shape * F.inverse();
    else
      ++left_out;
  }
  return left_out;
}

void MeshElasticity::set_shares(const Eigen::VectorXd& shares) {
  rest_volumes_ = elements_.volumes.cwiseProduct(mean_over_elements(mesh_, elements_, shares));
  volumes_ = rest_volumes_;
}

Eigen::Matrix3d MeshElasticity::displacement_gradient(Eigen::Index element, const Eigen::VectorXd& u) const {
  Eigen::Index row = elements_.vertices.starts[static_cast<std::size_t>(element)];
  Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
  for (const std::int32_t vertex : elements_.vertices_of(element)) {
    const std::int32_t place = unknowns_[static_cast<std::size_t>(vertex)];
    if (place >= 0) H += u.segment<3>(place) * gradients_.row(row);
    ++row;
  }
  return H;
}

void MeshElasticity::add_force(Eigen::Index element, const Eigen::Matrix3d& stress, Eigen::VectorXd& force) const {
  const Eigen::Matrix3d weighted = volumes_[element] * stress;
  Eigen::Index row = elements_.vertices.starts[static_cast<std::size_t>(element)];
  for (const std::int32_t vertex : elements_.vertices_of(element)) {
    const std::int32_t place = unknowns_[static_cast<std::size_t>(vertex)];
    if (place >= 0) force.segment<3>(place) += weighted * gradients_.row(row).transpose();
    ++row;
  }
}

// sum_bd g_i[b] (dP/dF)_(ab)(cd) g_j[d] for the vertices i, j and the axes a, c.
void MeshElasticity::add_stiffness(Eigen::Index element, const Matrix9& tangent, double* values) const {
  const auto vertices = elements_.vertices_of(element);
  const Eigen::Index first = elements_.vertices.starts[static_cast<std::size_t>(element)];
  const std::int32_t* slot = slots_.data() + starts_[static_cast<std::size_t>(element)];
  Eigen::Matrix<double, 3, 9> stresses;  // of unit displacements of vertex i, volume times dP/dF by rows
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    const std::int32_t row = unknowns_[static_cast<std::size_t>(vertices[i])];
    if (row < 0) continue;
    const Eigen::RowVector3d shape = volumes_[element] * gradients_.row(first + static_cast<Eigen::Index>(i));
    for (int a = 0; a < 3; ++a) stresses.row(a) = shape * tangent.middleRows<3>(3 * a);
    for (std::size_t j = 0; j < vertices.size(); ++j) {
      const std::int32_t column = unknowns_[static_cast<std::size_t>(vertices[j])];
      if (column < 0 || row < column) continue;
      const Eigen::Vector3d other = gradients_.row(first + static_cast<Eigen::Index>(j)).transpose();
      for (int c = 0; c < 3; ++c) {
        const Eigen::Vector3d entries = stresses.middleCols<3>(3 * c) * other;
        // Column c of the block, whose rows above the diagonal are not there.
        const Eigen::Index at = *slot + pattern_.outerIndexPtr()[column + c] - pattern_.outerIndexPtr()[column] - c;
        for (int a = row == column ? c : 0; a < 3; ++a) values[at + a] += entries[a];
      }
      ++slot;
    }
  }
}

// 1/2 u^T (S x I) u, and its derivative where it is asked for.
double MeshElasticity::add_variance(const Eigen::VectorXd& u, Eigen::VectorXd* force) const {
  if (!has_variance_) return 0;
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;
  const Eigen::Map<const Rows> rows(u.data(), size_ / 3, 3);
  const Rows pull = variance_ * rows;
  if (force != nullptr) Eigen::Map<Rows>(force->data(), size_ / 3, 3) += pull;
  return 0.5 * rows.cwiseProduct(pull).sum();
}

template <typename Work>
void MeshElasticity::for_each_element(const Eigen::VectorXd& u, Work&& work) const {
  with_material(materials_.model, [&](auto material) {
    for (Eigen::Index e = 0; e < elements_.count(); ++e)
      if (volumes_[e] > 0) work(material, e, displacement_gradient(e, u), elements_.lame(e));
  });
}

double MeshElasticity::energy(const Eigen::VectorXd& u) const {
  double sum = add_variance(u, nullptr);
  for_each_element(u, [&](auto material, Eigen::Index e, const Eigen::Matrix3d& H, const LameParameters& lame) {
    sum += volumes_[e] * material.energy(H, lame);
  });
  return sum;
}

double MeshElasticity::force(const Eigen::VectorXd& u, Eigen::VectorXd& force) const {
  force.setZero(size_);
  double sum = add_variance(u, &force);
  for_each_element(u, [&](auto material, Eigen::Index e, const Eigen::Matrix3d& H, const LameParameters& lame) {
    sum += volumes_[e] * material.energy(H, lame);
    add_force(e, material.first_piola_kirchhoff(H, lame), force);
  });
  return sum;
}

double MeshElasticity::force_and_stiffness(const Eigen::VectorXd& u, runtime::Tangent tangent, Eigen::VectorXd& force,
                                           LowerTriangle& stiffness) const {
  force.setZero(size_);
  stiffness = pattern_;
  if (has_variance_) stiffness.coeffs() = variance_values_;
  double* values = stiffness.valuePtr();
  double sum = add_variance(u, &force);
  for_each_element(u, [&](auto material, Eigen::Index e, const Eigen::Matrix3d& H, const LameParameters& lame) {
    sum += volumes_[e] * material.energy(H, lame);
    add_force(e, material.first_piola_kirchhoff(H, lame), force);
    add_stiffness(e,
                  tangent == runtime::Tangent::kExact ? Matrix9(material.tangent(H, lame))
                                                      : projected_tangent<decltype(material)>(H, lame),
                  values);
  });
  return sum;
}

Eigen::VectorXd MeshElasticity::values_of(const Eigen::SparseMatrix<double, Eigen::RowMajor>& matrix) const {
  Eigen::VectorXd values(pattern_.nonZeros());
  Eigen::Index entry = 0;
  for (Eigen::Index column = 0; column < size_; ++column)
    for (LowerTriangle::InnerIterator at(pattern_, column); at; ++at)
      values[entry++] = matrix.coeff(at.row(), at.col());
  return values;
}

}  // namespace exmat::precompute
