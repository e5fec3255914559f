#include "precompute/full_space/mesh_elasticity.h"

#include <algorithm>

#include "common/elastic/materials.h"
#include "common/mesh/geometry.h"

namespace exmat::precompute {

MeshElasticity::MeshElasticity(const TetMesh& mesh, const TetMaterials& materials,
                               const std::vector<std::int32_t>& free_dofs)
    : size_(std::ssize(free_dofs)), material_(materials.model), tets_(mesh.tets), volumes_(mesh.tet_count()) {
  std::vector<std::int32_t> place(static_cast<std::size_t>(3 * mesh.vertex_count()), -1);
  for (std::size_t i = 0; i < free_dofs.size(); ++i)
    place[static_cast<std::size_t>(free_dofs[i])] = static_cast<std::int32_t>(i);
  gradients_.resize(static_cast<std::size_t>(mesh.tet_count()));
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t) {
    lame_.push_back(lame_parameters(materials.youngs_modulus[t], materials.poisson_ratio[t]));
    Corners& dofs = dofs_.emplace_back();
    for (int i = 0; i < 12; ++i) dofs[i] = place[static_cast<std::size_t>(3 * mesh.tets(t, i / 3) + i % 3)];
  }
  set_undeformed(mesh.vertices);
  build_pattern();
}

void MeshElasticity::build_pattern() {
  std::vector<Eigen::Triplet<double>> entries;
  for (const Corners& dofs : dofs_)
    for (const auto row : dofs)
      for (const auto column : dofs)
        if (column >= 0 && row >= column) entries.emplace_back(row, column, 0.0);
  pattern_.resize(size_, size_);
  pattern_.setFromTriplets(entries.begin(), entries.end());
  const auto* rows = pattern_.innerIndexPtr();
  const auto* starts = pattern_.outerIndexPtr();
  for (const Corners& dofs : dofs_) {
    Slots& slots = slots_.emplace_back(Slots::Constant(-1));
    for (int j = 0; j < 12; ++j)
      for (int i = 0; dofs[j] >= 0 && i < 12; ++i)
        if (dofs[i] >= dofs[j])
          slots(i, j) = static_cast<std::int32_t>(
              std::lower_bound(rows + starts[dofs[j]], rows + starts[dofs[j] + 1], dofs[i]) - rows);
  }
}

Eigen::Index MeshElasticity::set_undeformed(const VertexArray& positions) {
  Eigen::Index left_out = 0;
  for (Eigen::Index t = 0; t < tets_.rows(); ++t) {
    Gradients corners;
    for (int i = 0; i < 4; ++i) corners.row(i) = positions.row(tets_(t, i));
    const Eigen::Matrix3d edges = corners.bottomRows<3>().rowwise() - corners.row(0);
    volumes_[t] = std::max(0.0, edges.row(0).cross(edges.row(1)).dot(edges.row(2)) / 6);
    if (volumes_[t] > 0)
      gradients_[static_cast<std::size_t>(t)] = shape_gradients(corners);
    else
      ++left_out;
  }
  if (shares_.size() > 0) volumes_ = volumes_.cwiseProduct(shares_);
  return left_out;
}

void MeshElasticity::set_shares(const Eigen::VectorXd& shares) {
  shares_ = shares;
  volumes_ = volumes_.cwiseProduct(shares_);
}

Eigen::Matrix3d MeshElasticity::displacement_gradient(Eigen::Index tet, const Eigen::VectorXd& u) const {
  const Corners& dofs = dofs_[static_cast<std::size_t>(tet)];
  Eigen::Matrix<double, 3, 4> corners;
  for (int i = 0; i < 12; ++i) corners(i % 3, i / 3) = dofs[i] >= 0 ? u[dofs[i]] : 0;
  return corners * gradients_[static_cast<std::size_t>(tet)];
}

void MeshElasticity::add_force(Eigen::Index tet, const Eigen::Matrix3d& stress, Eigen::VectorXd& force) const {
  const Corners& dofs = dofs_[static_cast<std::size_t>(tet)];
  const Eigen::Matrix<double, 3, 4> corners =
      volumes_[tet] * stress * gradients_[static_cast<std::size_t>(tet)].transpose();
  for (int i = 0; i < 12; ++i)
    if (dofs[i] >= 0) force[dofs[i]] += corners(i % 3, i / 3);
}

// sum_bd g_i[b] (dP/dF)_(ab)(cd) g_j[d] for the corners i, j and the axes a, c.
void MeshElasticity::add_stiffness(Eigen::Index tet, const Matrix9& tangent, double* values) const {
  const Gradients gradients = volumes_[tet] * gradients_[static_cast<std::size_t>(tet)];
  const Gradients& shape = gradients_[static_cast<std::size_t>(tet)];
  const Slots& slots = slots_[static_cast<std::size_t>(tet)];
  for (int j = 0; j < 4; ++j) {
    Eigen::Matrix<double, 9, 3> stresses;  // of unit displacements of corner j
    for (int c = 0; c < 3; ++c) stresses.col(c) = tangent.middleCols<3>(3 * c) * gradients.row(j).transpose();
    for (int i = 0; i < 4; ++i)
      for (int a = 0; a < 3; ++a) {
        const Eigen::RowVector3d entries = shape.row(i) * stresses.middleRows<3>(3 * a);
        for (int c = 0; c < 3; ++c)
          if (const auto slot = slots(3 * i + a, 3 * j + c); slot >= 0) values[slot] += entries[c];
      }
  }
}

template <typename Work>
void MeshElasticity::for_each_tet(const Eigen::VectorXd& u, Work&& work) const {
  with_material(material_, [&](auto material) {
    for (Eigen::Index t = 0; t < tet_count(); ++t)
      if (volumes_[t] > 0) work(material, t, displacement_gradient(t, u), lame_[static_cast<std::size_t>(t)]);
  });
}

double MeshElasticity::energy(const Eigen::VectorXd& u) const {
  double sum = 0;
  for_each_tet(u, [&](auto material, Eigen::Index t, const Eigen::Matrix3d& H, const LameParameters& lame) {
    sum += volumes_[t] * material.energy(H, lame);
  });
  return sum;
}

double MeshElasticity::force(const Eigen::VectorXd& u, Eigen::VectorXd& force) const {
  double sum = 0;
  force.setZero(size_);
  for_each_tet(u, [&](auto material, Eigen::Index t, const Eigen::Matrix3d& H, const LameParameters& lame) {
    sum += volumes_[t] * material.energy(H, lame);
    add_force(t, material.first_piola_kirchhoff(H, lame), force);
  });
  return sum;
}

double MeshElasticity::force_and_stiffness(const Eigen::VectorXd& u, runtime::Tangent tangent, Eigen::VectorXd& force,
                                           LowerTriangle& stiffness) const {
  double sum = 0;
  force.setZero(size_);
  stiffness = pattern_;
  double* values = stiffness.valuePtr();
  for_each_tet(u, [&](auto material, Eigen::Index t, const Eigen::Matrix3d& H, const LameParameters& lame) {
    sum += volumes_[t] * material.energy(H, lame);
    add_force(t, material.first_piola_kirchhoff(H, lame), force);
    add_stiffness(t,
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
