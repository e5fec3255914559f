#pragma once

#include <gtest/gtest.h>
#include <memory>

#include "runtime/sim/stepper.h"
#include "tests/support/synthetic_model.h"

namespace exmat::runtime {

inline std::unique_ptr<const Model> prepared(const test::Bar& bar) {
  ModelResult result = build_model(bar.model, {});
  EXPECT_TRUE(result.model) << to_string(result.complaint);
  return std::move(result.model);
}

/// No load, no damping, no examples.
inline StepScene free_scene(const Model& model, Integrator integrator, double time_step) {
  StepScene scene;
  scene.time_step = time_step;
  scene.integrator = integrator;
  scene.gravity_force = Eigen::VectorXd::Zero(model.modes());
  return scene;
}

inline constexpr std::array kIntegrators{Integrator::kBdf2, Integrator::kBackwardEuler, Integrator::kNewmark};

}  // namespace exmat::runtime
