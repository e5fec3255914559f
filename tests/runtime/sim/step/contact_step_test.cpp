#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>
#include <numbers>

#include "common/core/decompositions.h"
#include "runtime/sim/step/stepper.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/synthetic_model.h"

namespace exmat::runtime {
namespace {

constexpr double kGravity = 9.81;

/// A free block and a floor through the origin.
struct Dropped {
  explicit Dropped(double time_step, double stiffness, double friction = 0, double damping = 0, bool free = true)
      : bar(test::make_bar({.cells = {4, 2, 2}, .lengths = {0.4, 0.2, 0.2}, .youngs_modulus = 1e6, .free = free})) {
    bar.model.contact = test::surface_contact(bar.model);
    model = build_model(bar.model, {}).model;
    scene.time_step = time_step;
    scene.gravity = Eigen::Vector3d(0, 0, -kGravity);
    scene.gravity_force = gravity_force(*model, scene.gravity);
    if (free) scene.gravity_force.setZero();
    scene.obstacles.push_back(Obstacle{Plane{Eigen::Vector3d::Zero(), Eigen::Vector3d::UnitZ()}, RigidMotion(),
                                       stiffness, damping, friction});
    state = make_state(*model);
    prepare_contacts(*model, 1, state);
  }

  double mass() const { return bar.model.rigid->mass; }
  double energy() const { return energies(*model, scene, state).total(); }

  test::Bar bar;
  std::unique_ptr<const Model> model;
  StepScene scene;
  State state;
};

TEST(ContactStep, ADroppedBodyComesToRestAndTheFloorCarriesIt) {
  Dropped dropped(2e-3, 1e7, 0.5, 2e4);
  dropped.scene.mass_damping = 2;
  dropped.scene.stiffness_damping = 2e-3;
  free_state(dropped.state).position = Eigen::Vector3d(0, 0, 0.05);
  Workspace workspace(*dropped.model, dropped.scene);
  const double energy = dropped.mass() * kGravity * 0.05;
  StepReport report;
  Eigen::Vector3d there = Eigen::Vector3d::Zero();
  for (int i = 0; i < 3000; ++i) {
    report = step(*dropped.model, dropped.scene, dropped.state, workspace);
    ASSERT_FALSE(report.status & kStepNonFinite) << i;
    if (i == 1500) there = free_state(dropped.state).position;
  }
  EXPECT_LE(energies(*dropped.model, dropped.scene, dropped.state).kinetic, 1e-8 * energy);
  EXPECT_NEAR(report.contact_force[2], dropped.mass() * kGravity, 1e-3 * dropped.mass() * kGravity);
  EXPECT_LE((free_state(dropped.state).position - there).norm(), 1e-6);
  EXPECT_GT(report.contacts, 3);
}

TEST(ContactStep, SlidesOrStaysOnASlope) {
  constexpr double kSlope = 20 * std::numbers::pi / 180;
  for (const double friction : {0.2, 0.8}) {
    Dropped body(2e-3, 1e7, friction, 2e4);
    // The floor stays level; gravity leans.
    body.scene.gravity = kGravity * Eigen::Vector3d(std::sin(kSlope), 0, -std::cos(kSlope));
    body.scene.mass_damping = 2;
    body.scene.stiffness_damping = 2e-3;
    Workspace workspace(*body.model, body.scene);
    for (int i = 0; i < 500; ++i) step(*body.model, body.scene, body.state, workspace);
    const Eigen::Vector3d position = free_state(body.state).position;
    const double velocity = free_state(body.state).linear_momentum[0] / body.mass();
    constexpr int kSteps = 5000;
    for (int i = 0; i < kSteps; ++i) step(*body.model, body.scene, body.state, workspace);
    const double time = kSteps * body.scene.time_step;
    if (friction > std::tan(kSlope)) {
      EXPECT_LE((free_state(body.state).position - position).norm(), 1e-6);
    } else {
      const double acceleration = (free_state(body.state).linear_momentum[0] / body.mass() - velocity) / time;
      const double expected = kGravity * (std::sin(kSlope) - friction * std::cos(kSlope));
      EXPECT_NEAR(acceleration, expected, 0.02 * expected);
    }
  }
}

TEST(ContactStep, ImpactTakesNoEnergyAndMomentumIsTheIntegralOfTheForces) {
  for (const double time_step : {1e-4, 1e-3, 5e-3, 1e-2})
    for (const double stiffness : {1e4, 1e6, 1e8}) {
      Dropped dropped(time_step, stiffness, 0.3);
      FrameMotion motion;
      motion.position = Eigen::Vector3d(0, 0, 0.2);
      motion.orientation = Eigen::Quaterniond(Eigen::AngleAxisd(0.5, Eigen::Vector3d(1, 2, 0.5).normalized()));
      motion.linear_velocity = Eigen::Vector3d(1, 0, -3);
      motion.angular_velocity = Eigen::Vector3d(0, 4, 1);
      set_motion(*dropped.model, motion, dropped.state);
      Workspace workspace(*dropped.model, dropped.scene);
      const double energy = dropped.energy();
      const Eigen::Vector3d momentum = free_state(dropped.state).linear_momentum;
      Eigen::Vector3d impulse = Eigen::Vector3d::Zero();
      double highest = energy;
      int touching = 0;
      const int steps = static_cast<int>(1 / time_step);
      for (int i = 0; i < steps; ++i) {
        const StepReport report = step(*dropped.model, dropped.scene, dropped.state, workspace);
        ASSERT_FALSE(report.status & kStepNonFinite) << time_step << " " << stiffness << " " << i;
        impulse += time_step * (report.contact_force + dropped.mass() * dropped.scene.gravity);
        touching += report.contacts;
        highest = std::max(highest, dropped.energy());
      }
      EXPECT_GT(touching, 0);
      EXPECT_LE((free_state(dropped.state).linear_momentum - momentum - impulse).norm(),
                1e-10 * dropped.mass() * motion.linear_velocity.norm());
      EXPECT_LE(highest, energy + 1e-6 * dropped.mass() * 5) << time_step << " " << stiffness;
      EXPECT_LE((dropped.bar.basis() * dropped.state.q).lpNorm<Eigen::Infinity>(), dropped.bar.length);
    }
}

// One iteration leaves forces of the contacts that nothing balances. The momenta do not get them: they are those of the
// way that the body went, less where that would be more energy than before, and of the force that is reported.
TEST(ContactStep, AStepThatDoesNotConvergeGivesTheMomentumOfItsWay) {
  int unconverged = 0, slowed = 0, given_back = 0;
  struct Case {
    double time_step, stiffness;
    int iterations;
  };
  for (const auto& [dt, stiffness, iterations] :
       {Case{1.0 / 30, 1e6, 1}, Case{1.0 / 30, 1e8, 1}, Case{1e-2, 1e5, 2}, Case{3e-3, 1e7, 2}}) {
    Dropped dropped(dt, stiffness, 0.5);
    dropped.scene.newton.max_iterations = iterations;
    FrameMotion motion;
    motion.position = Eigen::Vector3d(0, 0, 0.05);
    motion.linear_velocity = Eigen::Vector3d(1, 0, -3);
    motion.angular_velocity = Eigen::Vector3d(0, 4, 1);
    set_motion(*dropped.model, motion, dropped.state);
    Workspace workspace(*dropped.model, dropped.scene);
    for (int i = 0; i < 10; ++i) {
      const FreeState before = free_state(dropped.state);
      const double energy = dropped.energy();
      const StepReport report = step(*dropped.model, dropped.scene, dropped.state, workspace);
      ASSERT_FALSE(report.status & kStepNonFinite);
      if ((report.status & kStepUnconverged) == 0) continue;
      ++unconverged;
      const FreeState& after = free_state(dropped.state);
      const Eigen::Vector3d of_way = dropped.mass() / dt * (after.position - before.position);
      // The rest is all of the flight without contacts and a share of what they gave; less of the flight only where
      // that is not enough, since the pose alone has the energy.
      Eigen::MatrixXd parts(3, 2);
      parts.col(0) = before.linear_momentum + dt * dropped.mass() * dropped.scene.gravity;
      parts.col(1) = of_way - parts.col(0);
      if (parts.col(1).norm() <= 1e-9 * of_way.norm()) continue;  // nothing touched
      const Eigen::VectorXd left = parts.colPivHouseholderQr().solve(after.linear_momentum);
      EXPECT_LE((after.linear_momentum - parts * left).norm(), 1e-9 * of_way.norm()) << stiffness << " step " << i;
      EXPECT_LE(left[0], 1 + 1e-9) << stiffness << " step " << i;
      EXPECT_LE(left[1], left[0] + 1e-9) << stiffness << " step " << i;
      if (left[1] < 1 - 1e-9) ++slowed;
      if (left[1] < 1 - 1e-9 && left[0] > 1 - 1e-9) ++given_back;
      // Standing still where the pose alone has more energy than there was.
      if (energies(*dropped.model, dropped.scene, dropped.state).kinetic > 0) {
        EXPECT_LE(dropped.energy(), energy + 1e-9 * std::abs(energy)) << stiffness << " step " << i;
      }
      const Eigen::Vector3d force = report.contact_force + dropped.mass() * dropped.scene.gravity;
      EXPECT_LE((after.linear_momentum - before.linear_momentum - dt * force).norm(), 1e-9 * of_way.norm());
    }
  }
  EXPECT_GT(unconverged, slowed);
  EXPECT_GT(slowed, given_back);
  EXPECT_GT(given_back, 0);
}

// Friction holds the body where it is put; left behind, its anchors would draw the body back.
TEST(ContactStep, FrictionGoesWithABodyThatIsPutElsewhere) {
  Dropped dropped(2e-3, 1e7, 0.5, 2e4);
  dropped.scene.mass_damping = 2;
  dropped.scene.stiffness_damping = 2e-3;
  Workspace workspace(*dropped.model, dropped.scene);
  for (int i = 0; i < 1500; ++i) step(*dropped.model, dropped.scene, dropped.state, workspace);
  State stays = dropped.state;
  FrameMotion motion = dropped.model->frame->motion(stays.frame);
  motion.position += Eigen::Vector3d(5, -3, 0);
  motion.orientation = Eigen::AngleAxisd(2, Eigen::Vector3d::UnitZ()) * motion.orientation;
  ASSERT_TRUE(move_body(*dropped.model, dropped.scene, motion, dropped.state, workspace));
  stays.begins_anew = true;
  for (int i = 0; i < 10; ++i) {
    step(*dropped.model, dropped.scene, stays, workspace);
    step(*dropped.model, dropped.scene, dropped.state, workspace);
    // Positions of 5 m have 1e-15 m, of which stiffness over mass and the step make velocities.
    EXPECT_LE((dropped.state.q - stays.q).norm(), 1e-9 * stays.q.norm()) << i;
    EXPECT_LE((free_state(dropped.state).linear_momentum).norm(), 1e-6 * dropped.mass()) << i;
  }
}

TEST(ContactStep, AwayFromObstaclesNothingIsLookedAt) {
  Dropped dropped(1e-3, 1e6);
  free_state(dropped.state).position = Eigen::Vector3d(0, 0, 50);
  Workspace workspace(*dropped.model, dropped.scene);
  StepScene without = dropped.scene;
  without.obstacles.clear();
  State alone = dropped.state;
  Workspace other(*dropped.model, without);
  for (int i = 0; i < 100; ++i) {
    step(*dropped.model, dropped.scene, dropped.state, workspace);
    step(*dropped.model, without, alone, other);
    ASSERT_EQ(workspace.near->contact.tested_vertices, 0);
  }
  EXPECT_EQ(dropped.state.q, alone.q);
  EXPECT_EQ(free_state(dropped.state).position, free_state(alone).position);
}

TEST(ContactStep, AllocatesNothing) {
  for (const bool free : {true, false}) {
    Dropped body(2e-3, 1e7, 0.5, 2e4, free);
    Workspace workspace(*body.model, body.scene);
    const test::AllocationCounter counter;
    int touching = 0;
    for (int i = 0; i < 5; ++i) touching += step(*body.model, body.scene, body.state, workspace).contacts;
    EXPECT_EQ(counter.count(), 0U);
    EXPECT_GT(touching, 0);
  }
}

// A clamped bar that is bent down by gravity onto a floor.
TEST(ContactStep, AClampedBodyRestsOnAnObstacle) {
  Dropped bar(2e-3, 1e7, 0, 2e4, /*free=*/false);
  bar.scene.gravity_force = gravity_force(*bar.model, Eigen::Vector3d(0, 0, -200));
  bar.scene.mass_damping = 20;
  Obstacle lower = *bar.scene.obstacles[0];
  lower.shape = Plane{Eigen::Vector3d(0, 0, -0.005), Eigen::Vector3d::UnitZ()};
  bar.scene.obstacles[0] = lower;
  Workspace workspace(*bar.model, bar.scene);
  StepReport report;
  for (int i = 0; i < 2000; ++i) report = step(*bar.model, bar.scene, bar.state, workspace);
  EXPECT_GT(report.contacts, 0);
  EXPECT_LE(bar.state.v.norm(), 1e-6);
  const Eigen::VectorXd u = bar.bar.basis() * bar.state.q;
  const VertexArray& rest = bar.bar.model.object->mesh.vertices;
  for (Eigen::Index i = 0; i < rest.rows(); ++i) EXPECT_GE(rest(i, 2) + u[3 * i + 2], -0.01) << i;
  // In equilibrium forces and contacts cancel.
  Eigen::VectorXd internal(bar.model->modes());
  bar.model->internal_force.force(bar.state.q, workspace.elasticity, internal);
  const Eigen::VectorXd residual = internal - bar.scene.gravity_force - workspace.near->contact.generalised;
  EXPECT_LE(residual.norm(), 1e-5 * bar.scene.gravity_force.norm());
}

}  // namespace
}  // namespace exmat::runtime
