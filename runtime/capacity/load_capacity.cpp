#include "runtime/capacity/load_capacity.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <vector>

#include "common/core/decompositions.h"
#include "common/mesh/assembly.h"

namespace exmat::runtime {
namespace {

/// [unknowns x 6] translations and turns about the origin.
Eigen::MatrixXd rigid_motions(const VertexArray& vertices) {
  Eigen::MatrixXd motions(3 * vertices.rows(), 6);
  for (Eigen::Index i = 0; i < vertices.rows(); ++i) {
    const Eigen::Vector3d x = vertices.row(i);
    motions.block<3, 3>(3 * i, 0).setIdentity();
    for (int axis = 0; axis < 3; ++axis) motions.block<3, 1>(3 * i, 3 + axis) = Eigen::Vector3d::Unit(axis).cross(x);
  }
  return motions;
}

}  // namespace

LoadCapacity::LoadCapacity(const ReducedModel& model, double spread)
    : spread_(spread), vertices_(model.object->mesh.vertices) {
  const ObjectData& object = *model.object;
  Eigen::Index count = 0;
  for (Eigen::Index i = 0; i < vertices_.rows(); ++i) {
    const bool fixed = object.fixed[i] != 0;
    place_.push_back(fixed ? -1 : count);
    if (!fixed) count += 3;
  }
  const RowMatrix& basis = model.modal->basis;
  const bool free = count == 3 * vertices_.rows();
  reduced_basis_.resize(count, basis.cols() + (free ? 6 : 0));
  for (Eigen::Index i = 0; i < vertices_.rows(); ++i)
    if (place_[static_cast<std::size_t>(i)] >= 0)
      reduced_basis_.block(place_[static_cast<std::size_t>(i)], 0, 3, basis.cols()) = basis.middleRows<3>(3 * i);
  if (free) reduced_basis_.rightCols<6>() = rigid_motions(vertices_);

  std::vector<std::int32_t> unknowns;
  for (std::int32_t i = 0; i < 3 * vertices_.rows(); ++i)
    if (place_[static_cast<std::size_t>(i / 3)] >= 0) unknowns.push_back(i);
  const SparseMatrix mass = submatrix(expand_to_vectors(scalar_mass(object.mesh, object.materials.density)), unknowns),
                     stiffness = submatrix(elastic_stiffness(object.mesh, object.materials), unknowns);
  const auto modes = reduced_basis_.leftCols(basis.cols());
  const Eigen::MatrixXd reduced_stiffness = modes.transpose() * (stiffness * modes);
  const double lowest = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(reduced_stiffness, Eigen::EigenvaluesOnly)
                            .eigenvalues()
                            .minCoeff();
  const double square = std::max(lowest, 1e-12 * reduced_stiffness.trace());
  time_scale_ = 1 / std::sqrt(square);
  const Eigen::SparseMatrix<double> all = mass + stiffness / square;
  full_.compute(all);
  reduced_.compute(reduced_basis_.transpose() * (all * reduced_basis_));
  weigh_surface(object);
}

void LoadCapacity::weigh_surface(const ObjectData& object) {
  areas_.setZero(vertices_.rows());
  for (Eigen::Index f = 0; f < object.surface.rows(); ++f) {
    const auto corner = [&](int c) { return Eigen::Vector3d(vertices_.row(object.surface(f, c))); };
    const double area = 0.5 * (corner(1) - corner(0)).cross(corner(2) - corner(0)).norm();
    for (int c = 0; c < 3; ++c) areas_[object.surface(f, c)] += area / 3;
  }
}

Eigen::VectorXd LoadCapacity::spread_load(const VertexArray& places, const VertexArray& forces) const {
  Eigen::VectorXd load = Eigen::VectorXd::Zero(vertices_.size());
  Eigen::VectorXd shares(vertices_.rows());
  for (Eigen::Index k = 0; k < places.rows(); ++k) {
    const Eigen::VectorXd squares = (vertices_.rowwise() - places.row(k)).rowwise().squaredNorm();
    Eigen::Index nearest = 0;
    double least = std::numeric_limits<double>::infinity();
    for (Eigen::Index i = 0; i < squares.size(); ++i) {
      const double near = spread_ > 0 ? std::max(0.0, 1 - squares[i] / (spread_ * spread_)) : 0;
      shares[i] = areas_[i] * near * near;
      if (areas_[i] > 0 && squares[i] < least) {
        least = squares[i];
        nearest = i;
      }
    }
    if (!(shares.sum() > 0)) shares[nearest] = 1;
    shares /= shares.sum();
    for (Eigen::Index i = 0; i < shares.size(); ++i) load.segment<3>(3 * i) += shares[i] * forces.row(k).transpose();
  }
  return load;
}

double LoadCapacity::lost_share(const Eigen::VectorXd& load) const {
  Eigen::VectorXd free(unknowns());
  for (std::size_t i = 0; i < place_.size(); ++i)
    if (place_[i] >= 0) free.segment<3>(place_[i]) = load.segment<3>(3 * static_cast<Eigen::Index>(i));
  if (const double largest = free.cwiseAbs().maxCoeff(); largest > 0) free /= largest;  // squares of others may be 0
  const double whole = free.dot(full_.solve(free));
  if (!(whole > 0)) return 0;
  const Eigen::VectorXd reduced = reduced_basis_.transpose() * free;
  return std::clamp(1 - reduced.dot(reduced_.solve(reduced)) / whole, 0.0, 1.0);
}

}  // namespace exmat::runtime
