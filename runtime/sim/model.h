#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>

#include "common/core/arrays.h"
#include "common/core/error.h"
#include "common/model/reduced_model.h"
#include "runtime/sim/example_force.h"
#include "runtime/sim/example_weights.h"
#include "runtime/sim/reduced_elasticity.h"
#include "runtime/sim/target.h"

namespace exmat::runtime {

/// What example forces need. K examples.
struct ExampleModel {
  ExampleWeights weights;
  TargetSolver target;
  ShapeFilter filter;
};

/// A reduced body prepared for stepping: immutable, shared by any number of States.
struct Model {
  ReducedElasticity elasticity;
  RowMatrix gravity_load;                ///< 3 x r
  std::optional<ExampleModel> examples;  ///< absent: this model was prepared without

  Eigen::Index modes() const { return elasticity.modes(); }
  Eigen::Index example_count() const { return examples ? examples->weights.examples() : 0; }
};

struct ModelOptions {
  bool examples = true;  ///< prepare example forces, if the bundle has examples
  EnergyReference energy_reference = EnergyReference::kExample;
};

/// The model, or why there is none: a group that is missing, an unknown material, an example that inverts an element.
struct ModelResult {
  std::unique_ptr<const Model> model;
  Complaint complaint;  ///< without a file
};
ModelResult build_model(const ReducedModel& reduced, const ModelOptions& options);

}  // namespace exmat::runtime
