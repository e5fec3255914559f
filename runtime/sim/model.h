#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>

#include "common/core/arrays.h"
#include "common/core/error.h"
#include "common/model/reduced_model.h"
#include "runtime/sim/carried_motion.h"
#include "runtime/sim/contact.h"
#include "runtime/sim/example_force.h"
#include "runtime/sim/example_weights.h"
#include "runtime/sim/internal_force.h"
#include "runtime/sim/rigid_frame.h"
#include "runtime/sim/target.h"
#include "runtime/sim/target_table.h"

namespace exmat::runtime {

/// What example forces need. K examples.
struct ExampleModel {
  ExampleWeights weights;
  std::optional<TargetTable> table;    ///< of P_s p*, serves the targets if there is one
  std::optional<TargetSolver> target;  ///< otherwise
  Eigen::MatrixXd filtered_basis;      ///< r x d, P_s Z, with `target`
  ShapeFilter filter;                  ///< P_s
};

/// A reduced body prepared for stepping: immutable, shared by any number of States.
struct Model {
  InternalForce internal_force;
  RowMatrix gravity_load;                ///< 3 x r
  std::optional<ContactSet> contact;     ///< of a scene with obstacles
  std::optional<RigidFrame> rigid;       ///< of a free body
  std::optional<CarriedFrame> carried;   ///< of a body whose fixed part a motion carries
  std::optional<ExampleModel> examples;  ///< absent: this model was prepared without

  Eigen::Index modes() const { return internal_force.modes(); }
  Eigen::Index example_count() const { return examples ? examples->weights.examples() : 0; }
};

struct ModelOptions {
  bool examples = true;       ///< prepare example forces, if the bundle has examples
  bool target_table = false;  ///< take targets from /targets; false: solve for them
  bool carried = false;       ///< a motion carries the body's fixed part: /rigid
  bool polynomial = false;    ///< internal force by /polynomial; false: by cubature
  EnergyReference energy_reference = EnergyReference::kExample;
};

/// The model, or why there is none: a group that is missing, an unknown material, an example that inverts an element.
struct ModelResult {
  std::unique_ptr<const Model> model;
  Complaint complaint;  ///< without a file
};
ModelResult build_model(const ReducedModel& reduced, const ModelOptions& options);

}  // namespace exmat::runtime
