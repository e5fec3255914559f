#include "runtime/sim/step/integrator.h"

#include <cmath>
#include <gtest/gtest.h>

#include "common/core/decompositions.h"
#include "tests/support/scenes.h"

namespace exmat::runtime {
namespace {

using test::Bar;

/// Free oscillation in the linear regime: qddot + (alpha + beta K) qdot + K q = 0 by modes of K.
class LinearOscillation : public ::testing::Test {
 protected:
  LinearOscillation() : bar_(test::make_bar({.cells = {5, 2, 2}})), model_(prepared(bar_)) {
    const Eigen::MatrixXd stiffness = bar_.basis().transpose() * bar_.stiffness * bar_.basis();
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(stiffness);
    modes_ = solver.eigenvectors();
    frequencies_ = solver.eigenvalues().cwiseSqrt();
    start_ = kAmplitude * bar_.length * (modes_.col(0) + 0.3 * modes_.col(2));
    velocity_ = kAmplitude * bar_.length * frequencies_[0] * (0.5 * modes_.col(1) - 0.2 * modes_.col(0));
  }

  Eigen::VectorXd exact(double time, double alpha, double beta) const {
    Eigen::VectorXd modal(start_.size());
    for (Eigen::Index i = 0; i < modal.size(); ++i) {
      const double omega = frequencies_[i], decay = 0.5 * (alpha + beta * omega * omega);
      const double damped = std::sqrt(omega * omega - decay * decay);
      const double position = modes_.col(i).dot(start_), speed = modes_.col(i).dot(velocity_);
      modal[i] = std::exp(-decay * time) *
                 (position * std::cos(damped * time) + (speed + decay * position) / damped * std::sin(damped * time));
    }
    return modes_ * modal;
  }

  double end_time() const { return 4 / frequencies_[0]; }

  State run(Integrator integrator, int steps, double alpha, double beta) const {
    StepScene scene = free_scene(*model_, integrator, end_time() / steps);
    scene.mass_damping = alpha;
    scene.stiffness_damping = beta;
    scene.newton.tolerance = 1e-11;
    State state = make_state(*model_, start_, velocity_);
    Workspace workspace(*model_, scene);
    for (int i = 0; i < steps; ++i) EXPECT_EQ(step(*model_, scene, state, workspace).status & kStepNonFinite, 0U);
    return state;
  }

  /// log2 of the ratio of the errors of `steps` and 2 `steps`.
  double observed_order(Integrator integrator, int steps, double alpha, double beta) const {
    const Eigen::VectorXd expected = exact(end_time(), alpha, beta);
    const double coarse = (run(integrator, steps, alpha, beta).q - expected).norm();
    const double fine = (run(integrator, 2 * steps, alpha, beta).q - expected).norm();
    EXPECT_LE(fine, 0.05 * start_.norm());
    return std::log2(coarse / fine);
  }

  static constexpr double kAmplitude = 1e-7;

  Bar bar_;
  std::unique_ptr<const Model> model_;
  Eigen::MatrixXd modes_;
  Eigen::VectorXd frequencies_, start_, velocity_;
};

TEST_F(LinearOscillation, BackwardEulerIsOfFirstOrder) {
  EXPECT_NEAR(observed_order(Integrator::kBackwardEuler, 2000, 0, 0), 1, 0.1);
  EXPECT_NEAR(observed_order(Integrator::kBackwardEuler, 2000, 0.5, 1e-3), 1, 0.1);
}

TEST_F(LinearOscillation, Bdf2IsOfSecondOrder) {
  EXPECT_NEAR(observed_order(Integrator::kBdf2, 400, 0, 0), 2, 0.1);
  EXPECT_NEAR(observed_order(Integrator::kBdf2, 400, 0.5, 1e-3), 2, 0.1);
}

TEST_F(LinearOscillation, NewmarkIsOfSecondOrder) {
  EXPECT_NEAR(observed_order(Integrator::kNewmark, 400, 0, 0), 2, 0.1);
  EXPECT_NEAR(observed_order(Integrator::kNewmark, 400, 0.5, 1e-3), 2, 0.1);
}

TEST_F(LinearOscillation, NewmarkConservesEnergy) {
  StepScene scene = free_scene(*model_, Integrator::kNewmark, end_time() / 100);
  scene.newton.tolerance = 1e-11;
  State state = make_state(*model_, start_, velocity_);
  Workspace workspace(*model_, scene);
  const auto total = [&] {
    const Energies now = energies(*model_, scene, state);
    return now.kinetic + now.elastic;
  };
  const double initial = total();
  for (int i = 0; i < 2000; ++i) {
    step(*model_, scene, state, workspace);
    ASSERT_NEAR(total(), initial, 1e-6 * initial);
  }
}

TEST_F(LinearOscillation, BackwardEulerAndBdf2OnlyLoseEnergy) {
  for (const Integrator integrator : {Integrator::kBackwardEuler, Integrator::kBdf2}) {
    const State coarse = run(integrator, 100, 0, 0);
    const StepScene scene = free_scene(*model_, integrator, 1);
    const Energies first = energies(*model_, scene, make_state(*model_, start_, velocity_));
    const Energies last = energies(*model_, scene, coarse);
    EXPECT_LT(last.kinetic + last.elastic, first.kinetic + first.elastic);
  }
}

/// A body without stiffness to speak of: the force alone decides the velocity.
TEST(ForceSwitchTest, TheImpulseOfAScriptedForceIsExact) {
  const Bar bar = test::make_bar({.youngs_modulus = 1e-9});
  const auto model = prepared(bar);
  const Eigen::VectorXd force = 1e-3 * model->gravity_load.row(1).transpose();
  for (const Integrator integrator : kIntegrators) {
    StepScene scene = free_scene(*model, integrator, 0.01);
    scene.newton.tolerance = 1e-12;
    scene.forces.push_back({force, 0.05, 0.2});
    State state = make_state(*model);
    Workspace workspace(*model, scene);
    for (int i = 0; i < 40; ++i) {
      step(*model, scene, state, workspace);
      const double impulse = std::clamp(state.time - 0.05, 0.0, 0.15);
      ASSERT_LE((state.v - impulse * force).norm(), 1e-6 * impulse * force.norm() + 1e-15) << state.time;
    }
  }
}

}  // namespace
}  // namespace exmat::runtime
