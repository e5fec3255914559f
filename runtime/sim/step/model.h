#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/core/arrays.h"
#include "common/core/error.h"
#include "common/model/reduced_model.h"
#include "runtime/sim/contact/contact.h"
#include "runtime/sim/elasticity/internal_force.h"
#include "runtime/sim/examples/example_force.h"
#include "runtime/sim/examples/example_weights.h"
#include "runtime/sim/examples/target.h"
#include "runtime/sim/examples/target_elasticity.h"
#include "runtime/sim/examples/target_table.h"
#include "runtime/sim/frame/body_frame.h"
#include "runtime/sim/frame/skeleton.h"

namespace exmat::runtime {

/// Data of one example force. K examples.
struct ExampleModel {
  std::string region;  ///< empty: the whole body
  ExampleWeights weights;
  /// Table of the pull U^T P p* or, with `elasticity`, coordinates y; serves the targets if there is one.
  std::optional<TargetTable> table;
  std::optional<TargetSolver> target;          ///< otherwise
  Eigen::MatrixXd target_pull;                 ///< r x d, with `target`: the pull of its coordinates y
  std::optional<TargetElasticity> elasticity;  ///< present for an elastic force
  Eigen::MatrixXd filter;                      ///< r x r, P_s = U^T P U, symmetric
};

/// A reduced body prepared for stepping: immutable, shared by any number of States.
struct Model {
  InternalForce internal_force;
  RowMatrix gravity_load;                    ///< 3 x r
  std::shared_ptr<const BodyFrame> frame;    ///< the body deforms in it
  std::shared_ptr<const Skeleton> skeleton;  ///< that the body hangs on; null: on none
  std::optional<ContactSet> contact;         ///< present for a scene with obstacles
  std::vector<ExampleModel> examples;        ///< the whole body's, then those of regions; none where prepared without

  Eigen::Index modes() const { return internal_force.modes(); }
  bool has_whole_body_examples() const { return !examples.empty() && examples.front().region.empty(); }
  Eigen::Index example_count() const {  ///< K of the whole body
    return has_whole_body_examples() ? examples.front().weights.examples() : 0;
  }
  Eigen::Index region_count() const {
    return static_cast<Eigen::Index>(examples.size()) - (has_whole_body_examples() ? 1 : 0);
  }
  /// The i-th region's; null where there is none.
  const ExampleModel* region(Eigen::Index i) const {
    if (i < 0 || i >= region_count()) return nullptr;
    return &examples[static_cast<std::size_t>(i) + (has_whole_body_examples() ? 1 : 0)];
  }
};

struct RegionOptions {
  std::string region;
  bool target_table = false;
  bool elastic = false;
  EnergyReference energy_reference = EnergyReference::kExample;
};

struct ModelOptions {
  bool examples = true;       ///< prepare the whole body's example force, if the bundle has examples
  bool target_table = false;  ///< take targets from /targets; false: solve for them
  bool elastic = false;       ///< prepare an elastic example force: /target_elasticity
  bool carried = false;       ///< a motion carries the body's fixed part: /rigid
  bool polynomial = false;    ///< internal force by /polynomial; false: by cubature
  EnergyReference energy_reference = EnergyReference::kExample;
  std::vector<RegionOptions> regions{};  ///< local example forces, in this order
};

/// The model, or why there is none: a group that is missing, an unknown material, an example that inverts an element.
struct ModelResult {
  std::unique_ptr<const Model> model;
  Complaint complaint;  ///< without a file
};
ModelResult build_model(const ReducedModel& reduced, const ModelOptions& options);

}  // namespace exmat::runtime
