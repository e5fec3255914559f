#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>

#include "common/model/reduced_model.h"
#include "runtime/sim/examples/example_weights.h"
#include "runtime/sim/examples/target_table.h"
#include "runtime/sim/space/full/carried_part.h"
#include "runtime/sim/space/full/full_contacts.h"
#include "runtime/sim/space/full/full_space.h"
#include "runtime/sim/space/full/rigid_part.h"
#include "runtime/sim/space/full/skinned_part.h"
#include "runtime/sim/step/model.h"

namespace exmat::runtime {

/// The whole body's examples in full space: weights and targets in the coefficients c = W^T u [3m], row 3i + axis.
struct FullExamples {
  ExampleWeights weights;
  std::optional<TargetTable> table;  ///< gives c*; else `from_target`
  Eigen::MatrixXd from_target;       ///< 3m x d: c* of the coordinates that the model's TargetSolver has
  Eigen::MatrixXd shapes;            ///< f x d, u* of those that it or the model's table has; of an elastic force
  Eigen::MatrixX3d rest;             ///< m x 3, W^T X of a body whose frame moves, X about the frame's origin
  Eigen::VectorXd ones;              ///< [m] W^T 1 of such a body; 0 of a free one

  /// Frame that moves, and the coefficient in it of the deformation, by the one of the displacement in the world.
  struct Frame {
    Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
    Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< origin, world [m]
  };
  Eigen::Vector3d to_frame(Eigen::Index k, const Frame& frame, const Eigen::Vector3d& moved) const noexcept {
    const Eigen::Vector3d at_rest = rest.row(k);
    return frame.rotation.transpose() * (at_rest + moved - ones[k] * frame.position) - at_rest;
  }
};

/// A body prepared for steps in all its vertices: immutable, shared by any number of States. f unknowns, r modes.
struct FullModel {
  FullModel() = default;
  /// For steps of the body alone.
  explicit FullModel(FullSpace of) : space(std::move(of)) {}

  FullSpace space;
  std::optional<RigidPart> rigid;        ///< present for a free body
  std::optional<CarriedPart> carried;    ///< present where a motion carries the fixed vertices
  std::optional<SkinnedPart> skin;       ///< present for a body on a skeleton
  std::optional<FullContacts> contacts;  ///< present where the model has contact
  std::optional<FullExamples> examples;
  bool is_elastic = false;  ///< true if the example force may be elastic
  /// True if something else moves the fixed vertices.
  bool is_driven() const { return carried || skin; }

  /// Writes how coefficients follow the frame, where it moves, into the body's examples.
  void set_frame_of_examples();
  /// The shapes [3n x d] that an elastic force of the reduced body's examples takes.
  void set_shapes(const RowMatrix& all, const ExampleModel& reduced);

  VertexArray rest;      ///< n x 3, X of all vertices of the mesh, world [m]
  RowMatrix basis;       ///< f x r, U of the vertices that move
  RowMatrix projection;  ///< f x r, M U
};

/// The model, or why there is none, from /object, /modal and, with examples, /full_space; `model` is that of the same
/// bundle.
struct FullModelResult {
  std::unique_ptr<const FullModel> model;
  Complaint complaint;  ///< without a file
};
FullModelResult build_full_model(const ReducedModel& reduced, const Model& model);

}  // namespace exmat::runtime
