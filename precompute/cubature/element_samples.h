#pragma once

#include <vector>

#include "common/core/arrays.h"
#include "common/mesh/assembly.h"
#include "common/mesh/elements.h"
#include "common/model/reduced_model.h"
#include "runtime/kernels/aligned_array.h"

namespace exmat::precompute {

/// A part is summed by itself where elements are many: the same parts, and so the same sum, for every number of
/// threads.
struct Part {
  Eigen::Index begin = 0, end = 0;
};
std::vector<Part> parts_of(Eigen::Index count);

/// Poses as the kernels take them (kernels.h), kLanes of them side by side; zeros after the last.
class PoseLanes {
 public:
  /// [N x r].
  explicit PoseLanes(const RowMatrix& poses);

  Eigen::Index count() const { return count_; }
  Eigen::Index groups() const { return (count_ + runtime::kLanes - 1) / runtime::kLanes; }
  const double* group(Eigen::Index index) const { return numbers_.data() + index * modes_ * runtime::kLanes; }

 private:
  Eigen::Index count_, modes_;
  runtime::AlignedArray numbers_;
};

/// Reduced forces [r] and energies of one element or a sum of elements at N poses, as the kernels leave them: for each
/// group of kLanes poses r rows of forces and one of energies, a pose in each column. Columns after the last pose are
/// zeros.
class Responses {
 public:
  Responses(Eigen::Index modes, const PoseLanes& poses)
      : rows_(modes + 1), poses_(poses.count()), numbers_(poses.groups() * rows_ * runtime::kLanes) {}

  using Group = Eigen::Map<Eigen::Array<double, runtime::kLanes, Eigen::Dynamic>>;
  using ConstGroup = Eigen::Map<const Eigen::Array<double, runtime::kLanes, Eigen::Dynamic>>;
  /// [kLanes x (r + 1)], a pose in each row; energies are the last column.
  Group group(Eigen::Index index) { return {numbers_.data() + begin(index), runtime::kLanes, rows_}; }
  ConstGroup group(Eigen::Index index) const { return {numbers_.data() + begin(index), runtime::kLanes, rows_}; }
  Eigen::Index groups() const { return numbers_.size() / begin(1); }
  Eigen::Map<Eigen::VectorXd> numbers() { return {numbers_.data(), numbers_.size()}; }
  Eigen::Map<const Eigen::VectorXd> numbers() const { return {numbers_.data(), numbers_.size()}; }

  Eigen::VectorXd force_norms() const;  ///< [N]
  Eigen::VectorXd energies() const;     ///< [N]
  double mean_energy() const { return energies().mean(); }

 private:
  Eigen::Index begin(Eigen::Index group) const { return group * rows_ * runtime::kLanes; }

  Eigen::Index rows_, poses_;
  runtime::AlignedArray numbers_;
};

/// Reduced elasticity of single elements: what cubature chooses from, and the sum over all of them.
class ElementSamples {
 public:
  /// `basis` is U, 3n x r. It and the mesh must outlive this.
  ElementSamples(const TetMesh& mesh, const TetMaterials& materials, const RowMatrix& basis);

  const Elements& elements() const { return elements_; }
  Eigen::Index count() const { return elements_.count(); }
  Eigen::Index modes() const { return basis_.cols(); }
  double volume(Eigen::Index element) const { return elements_.volumes[element]; }
  LameParameters lame(Eigen::Index element) const { return elements_.lame(element); }

  /// [9 x r] B_j = dF/dq, row 3a + b.
  RowMatrix gradient(Eigen::Index element) const;

  /// Collects elements, volumes, gradients and parameters of some; weights are the caller's to set.
  CubatureData data_of(const std::vector<Eigen::Index>& elements) const;

  /// [r x r] U^T (S x I) U, the constant part of the stiffness; zero of linear elements.
  RowMatrix variance() const;

  /// Sets `responses`, which have the size that the poses ask for, to those of one element, times its volume.
  void respond(Eigen::Index element, const PoseLanes& poses, Responses& responses) const;

  /// [r x r] at each of the poses: the sum of the reduced stiffnesses of elements, times weights [s] and volumes,
  /// without the constant part. The same for every number of threads.
  std::vector<Eigen::MatrixXd> stiffness(const std::vector<Eigen::Index>& elements, const Eigen::VectorXd& weights,
                                         const PoseLanes& poses) const;

 private:
  void write_gradient(Eigen::Index element, Eigen::Index stride, double* numbers) const;
  void add_stiffness(const std::vector<Eigen::Index>& elements, const Eigen::VectorXd& weights, Part part,
                     const PoseLanes& poses, std::vector<runtime::AlignedArray>& sums) const;

  const TetMesh& mesh_;
  const TetMaterials& materials_;
  const RowMatrix& basis_;
  Elements elements_;
};

}  // namespace exmat::precompute
