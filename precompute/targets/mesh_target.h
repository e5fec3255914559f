#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "common/model/reduced_model.h"
#include "precompute/fem/elastic_system.h"
#include "runtime/sim/examples/target.h"

namespace exmat::precompute {

/// Displacements B y that targets are sought among, and the poses of K examples there. f free degrees of freedom.
struct PoseCoordinates {
  Eigen::MatrixXd basis;  ///< f x d, B
  Eigen::MatrixXd poses;  ///< d x K, y_k: the rest pose first
};

/// Members that the stage cache keeps.
template <typename Archive>
void pass_members(Archive& archive, PoseCoordinates& value) {
  pass_all(archive, value.basis, value.poses);
}

/// All poses that descriptors stand for, mass-orthonormal: the range of `fields` [f x 3m], the displacements of unit
/// changes of descriptor; `changes` [3m x K] are those of the examples.
PoseCoordinates pose_range(const SparseMatrix& mass, const Eigen::MatrixXd& fields, const Eigen::MatrixXd& changes);

/// [3m x K] changes of descriptor from the object's own to the examples, entry 3i + axis.
Eigen::MatrixXd descriptor_changes(const RowMatrix& rest_descriptor, const ExampleSet& set);

class ElementForces;

/// The energies of targets over the elements of a mesh.
struct MeshTarget {
  runtime::TargetSolver solver;  ///< in coordinates of unit stiffness at rest, `solver.basis()` [d x d] away from y
  std::vector<Eigen::Index> elements;  ///< that take part, ascending
  Eigen::Index left_out = 0;  ///< elements that an example turns inside out, where the energies start from examples
  std::shared_ptr<const ElementForces> all;  ///< forces of all, where the solver has a sample of the elements alone
};

/// Throws InputError where no element is left.
MeshTarget mesh_target(const ObjectData& object, const ElasticSystem& system, const PoseCoordinates& coordinates,
                       EnergyReference reference);

/// A solver of a systematic sample of at most `most` elements, each for as many as it stands for, and the forces of
/// all. `object` must outlive it.
MeshTarget sampled_target(const ObjectData& object, const ElasticSystem& system, const PoseCoordinates& coordinates,
                          EnergyReference reference, Eigen::Index most);

/// The examples of a target solver, with the poses [d x K] as theirs.
std::vector<ExampleData> examples_at(const Eigen::MatrixXd& poses);

}  // namespace exmat::precompute
