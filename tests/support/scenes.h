#pragma once

#include <gtest/gtest.h>
#include <memory>

#include "runtime/sim/step/stepper.h"
#include "tests/support/synthetic_model.h"
#include "tests/support/synthetic_polynomial.h"
#include "tests/support/synthetic_targets.h"

namespace exmat::runtime {

inline std::unique_ptr<const Model> prepared(const test::Bar& bar, const ModelOptions& options = {}) {
  ModelResult result = build_model(bar.model, options);
  EXPECT_TRUE(result.model) << to_string(result.complaint);
  return std::move(result.model);
}

/// A bar with the polynomial of its energy and, if it has examples, a table of targets.
inline test::Bar full_bar(const test::BarOptions& options) {
  test::Bar bar = test::make_bar(options);
  bar.model.polynomial = test::make_polynomial(*bar.model.cubature);
  if (bar.model.examples) bar.model.targets = test::linear_targets(bar.model.examples->examples, 3);
  return bar;
}

/// A bar whose elastic example force is by the elements of its cubature, targets in reduced coordinates.
inline test::Bar elastic_bar(const test::BarOptions& options) {
  test::Bar bar = full_bar(options);
  const CubatureData& cubature = *bar.model.cubature;
  TargetElasticityData& data = bar.model.target_elasticity.emplace();
  data.weights = cubature.weights;
  data.volumes = cubature.volumes;
  data.gradient = data.target_gradient = cubature.gradient;
  data.youngs_modulus = cubature.youngs_modulus;
  data.poisson_ratio = cubature.poisson_ratio;
  data.control_points = bar.model.targets->control_points;
  return bar;
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
