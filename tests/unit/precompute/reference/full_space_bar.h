#pragma once

#include <gtest/gtest.h>

#include "precompute/reference/full_space_stepper.h"
#include "precompute/shape_space/projection.h"
#include "tests/support/synthetic_model.h"

namespace exmat::precompute {

/// The number of modes of a bar of a few cells that leave nothing out.
inline int all_modes(const test::BarOptions& options) {
  const auto [nx, ny, nz] = options.cells;
  const int section = 3 * (ny + 1) * (nz + 1);
  return options.free ? (nx + 1) * section - 6 : nx * section;
}

/// A bar with all modes in its basis and the example poses that descriptors stand for on all vertices.
inline test::Bar complete_bar(test::BarOptions options) {
  options.linear_modes = all_modes(options) - std::max(0, std::min(options.examples, 4) - 1);
  test::Bar bar = test::make_bar(options);
  if (options.examples == 0) return bar;
  ReducedModel& model = bar.model;
  const ElasticSystem system = build_elastic_system(model.object->mesh, model.object->materials, model.object->fixed);
  const Eigen::MatrixXd reduce = (system.mass * system.restrict(bar.basis())).transpose();
  const RowMatrix map = reduce * example_fields(model, system);
  for (ExampleData& example : model.examples->examples) {
    const RowMatrix change = example.descriptor - model.shape_space->rest_descriptor;
    example.pose = map * Eigen::VectorXd(change.reshaped<Eigen::RowMajor>());
  }
  model.projection->target_basis = range_basis(map);
  return bar;
}

inline FullSpaceOptions targets_of(const test::BarOptions& options) {
  return {.targets = options.examples > 0 ? ExampleTargets::kTets : ExampleTargets::kNone};
}

/// Steps, and expects each one to be sound.
inline void run(const FullSpaceModel& model, const FullSpaceScene& scene, FullSpaceState& state, int steps) {
  FullSpaceWorkspace workspace(model);
  for (int i = 0; i < steps; ++i) ASSERT_EQ(step(model, scene, state, workspace).status, 0U) << i;
}

inline FullSpaceState at_rest(const FullSpaceModel& model) {
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(model.rest.size());
  return make_full_space_state(model, zero, zero);
}

}  // namespace exmat::precompute
