#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <vector>

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

/// Examples of the whole body or of a region in full space: weights and targets in the coefficients c [3m], row 3i +
/// axis: W^T u of the whole body, W^T D'' u of a region (docs/method.md, "Regions").
struct FullExamples {
  ExampleWeights weights;
  Eigen::Index first = 0;      ///< of its functions among those of the space: the first m are W, of a region D W
  Eigen::Index functions = 0;  ///< m
  /// 3m x 3(m + kBandFunctions), of a region that is seen from its band: c by the coefficients of D W and of the band.
  Eigen::MatrixXd seen;
  std::optional<TargetTable> table;  ///< gives c*; else `from_target`
  Eigen::MatrixXd from_target;       ///< 3m x d: c* of the coordinates that the model's TargetSolver has
  Eigen::MatrixXd shapes;            ///< f x d, u* of those that it or the model's table has; of an elastic force
  Eigen::MatrixXd shifts;            ///< 3m x K, c of what each example shifts before the bones; else empty
  bool is_elastic = false;           ///< true if the force may be elastic
  Eigen::VectorXd shares;            ///< shares of the space's elements in such a force of a region; else empty

  Eigen::Index columns() const noexcept { return seen.size() > 0 ? seen.cols() / 3 : functions; }
};

/// Functions of a region's band beside its own: the share of each vertex, and that times its arm along each axis.
inline constexpr Eigen::Index kBandFunctions = 4;

/// Coefficients F^T u of a body whose frame moves, of the functions F of its space.
struct FrameOfFunctions {
  Eigen::MatrixX3d rest;  ///< F^T X, X about the frame's origin
  Eigen::VectorXd ones;   ///< F^T 1; 0 of a free body

  struct Frame {
    Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
    Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< origin, world [m]
  };
  /// The coefficient of the deformation in the frame, by the one of the displacement in the world.
  Eigen::Vector3d to_frame(Eigen::Index k, const Frame& frame, const Eigen::Vector3d& moved) const noexcept {
    const Eigen::Vector3d at_rest = rest.row(k);
    return frame.rotation.transpose() * (at_rest + moved - ones[k] * frame.position) - at_rest;
  }
};

/// Appends the functions of a group of examples to those of the space [n x M]: `filter` [n x m] and, of a region that
/// is seen from its band, the shares `band` [n] of the vertices in it; empty of others. `rest` [n x 3].
void append_functions(const RowMatrix& filter, const Eigen::VectorXd& band, const VertexArray& rest,
                      FullExamples& examples, RowMatrix& functions);

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
  std::vector<FullExamples> examples;    ///< as those of the Model; none: no example forces
  FrameOfFunctions functions;
  /// True if something else moves the fixed vertices.
  bool is_driven() const { return carried || skin; }

  /// Sets how coefficients follow the frame, where it moves; once there are examples.
  void set_frame_of_functions();

  VertexArray rest;         ///< n x 3, X of all vertices of the mesh, world [m]
  RowMatrix basis;          ///< f x r, U of the vertices that move
  AlignedArray projection;  ///< f x padded(r), M U by rows
};

/// The model, or why there is none, from /object, /modal and, with examples, /full_space; `model` is that of the same
/// bundle.
struct FullModelResult {
  std::unique_ptr<const FullModel> model;
  Complaint complaint;  ///< without a file
};
FullModelResult build_full_model(const ReducedModel& reduced, const Model& model);

}  // namespace exmat::runtime
