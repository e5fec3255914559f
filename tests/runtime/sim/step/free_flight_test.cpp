#include <Eigen/Geometry>
#include <cmath>
#include <gtest/gtest.h>
#include <numbers>
#include <vector>

#include "common/core/decompositions.h"
#include "runtime/sim/step/stepper.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/random.h"
#include "tests/support/synthetic_model.h"

namespace exmat::runtime {
namespace free_flight_test {

using test::Bar;

struct FreeBody {
  explicit FreeBody(const test::BarOptions& options = {.free = true, .examples = 3})
      : bar(test::make_bar(options)), model(build_model(bar.model, {}).model) {}

  StepScene scene(double time_step, Integrator integrator) const {
    StepScene scene;
    scene.time_step = time_step;
    scene.integrator = integrator;
    scene.gravity_force = Eigen::VectorXd::Zero(model->modes());
    return scene;
  }

  /// Spinning, moving and vibrating.
  State moving(double spin, double amplitude, std::uint32_t seed = 1) const {
    Eigen::VectorXd q = test::random_vector(model->modes(), seed);
    for (Eigen::Index i = 0; i < q.size(); ++i) q[i] /= static_cast<double>((i + 1) * (i + 1));
    const double largest = (bar.basis() * q).lpNorm<Eigen::Infinity>();
    q *= amplitude * bar.length / largest;
    State state = make_state(*model, q, 3 * q);
    FrameMotion motion;
    motion.position = Eigen::Vector3d(1, 2, 3);
    motion.orientation = Eigen::Quaterniond(0.5, 0.1, -0.7, 0.3).normalized();
    motion.linear_velocity = Eigen::Vector3d(1, -2, 0.5);
    motion.angular_velocity = spin * Eigen::Vector3d(0.3, 0.9, 0.2).normalized();
    set_motion(*model, motion, state);
    return state;
  }

  /// World positions about the origin and velocities of all vertices, from x = c + R (X + U q) itself.
  void vertices(const State& state, VertexArray& x, VertexArray& velocity) const {
    const VertexArray& rest = bar.model.object->mesh.vertices;
    const RigidData& rigid = *bar.model.rigid;
    const Eigen::Matrix3d R = free_state(state).orientation.toRotationMatrix();
    const Eigen::VectorXd u = bar.basis() * state.q, du = bar.basis() * state.v;
    x.resize(rest.rows(), 3);
    velocity.resize(rest.rows(), 3);
    for (Eigen::Index i = 0; i < rest.rows(); ++i) {
      const Eigen::Vector3d y = rest.row(i).transpose() - rigid.centre_of_mass + u.segment<3>(3 * i);
      x.row(i) = rigid.centre_of_mass + free_state(state).position + R * y;
      velocity.row(i) = free_state(state).linear_momentum / rigid.mass +
                        R * (free_state(state).spin.cross(y) + Eigen::Vector3d(du.segment<3>(3 * i)));
    }
  }

  struct Totals {
    Eigen::Vector3d centre, linear, angular;  ///< angular about the centre
    double kinetic;
  };
  Totals totals(const State& state) const {
    VertexArray x, velocity;
    vertices(state, x, velocity);
    const Eigen::Index n = x.rows();
    const Eigen::MatrixXd mass = bar.mass(Eigen::seqN(0, n, 3), Eigen::seqN(0, n, 3));
    const VertexArray momenta = mass * velocity;
    Totals totals;
    totals.centre = (mass * x).colwise().sum().transpose() / mass.sum();
    totals.linear = momenta.colwise().sum();
    totals.angular.setZero();
    for (Eigen::Index i = 0; i < n; ++i)
      totals.angular += Eigen::Vector3d(x.row(i).transpose() - totals.centre).cross(Eigen::Vector3d(momenta.row(i)));
    totals.kinetic = 0.5 * velocity.cwiseProduct(momenta).sum();
    return totals;
  }

  Bar bar;
  std::unique_ptr<const Model> model;
};

double total(const FreeBody& body, const StepScene& scene, const State& state) {
  return energies(*body.model, scene, state).total();
}

TEST(FreeFlight, StateIsThatOfTheVertices) {
  const FreeBody body;
  const StepScene scene = body.scene(1e-3, Integrator::kBdf2);
  const State state = body.moving(10, 0.1);
  const auto totals = body.totals(state);
  EXPECT_LE((totals.linear - free_state(state).linear_momentum).norm(), 1e-12 * totals.linear.norm());
  EXPECT_LE((totals.angular - free_state(state).angular_momentum).norm(), 1e-12 * totals.angular.norm());
  EXPECT_NEAR(totals.kinetic, energies(*body.model, scene, state).kinetic, 1e-12 * totals.kinetic);
}

struct Flight {
  Integrator integrator;
  double time_step, spin;
  bool examples;
};

class FreeFlights : public ::testing::TestWithParam<Flight> {};

std::vector<Flight> flights() {
  std::vector<Flight> all;
  for (const Integrator integrator : {Integrator::kBdf2, Integrator::kBackwardEuler, Integrator::kNewmark})
    for (const double time_step : {1e-4, 1e-3, 1e-2})
      for (const double spin : {10.0, 100.0})
        for (const bool examples : {false, true}) all.push_back({integrator, time_step, spin, examples});
  return all;
}

INSTANTIATE_TEST_SUITE_P(All, FreeFlights, ::testing::ValuesIn(flights()));

TEST_P(FreeFlights, KeepMomentaAndEnergy) {
  const auto [integrator, time_step, spin, examples] = GetParam();
  const FreeBody body;
  StepScene scene = body.scene(time_step, integrator);
  if (examples) scene.examples = {ExampleSettings{400, 2, 0.6, 4}};
  State state = body.moving(spin, 0.02);
  Workspace workspace(*body.model, scene);
  const auto first = body.totals(state);
  const double energy = total(body, scene, state);
  double highest = energy, before = energy;
  // Rounding adds up over a hundred seconds at one length of the steps; the others and the examples take fewer of them.
  const int steps = time_step == 1e-3 && !examples ? 100000 : 20000;
  for (int i = 0; i < steps; ++i) {
    const StepReport report = step(*body.model, scene, state, workspace);
    ASSERT_EQ(report.status & (kStepNonFinite | kStepIterationLimit), 0U) << i;
    const double now = total(body, scene, state);
    // 1e-9: the tolerance of Newton's method.
    if (integrator == Integrator::kBackwardEuler && !examples) {
      ASSERT_LE(now, before + 1e-9 * energy) << i;
    }
    highest = std::max(highest, now);
    before = now;
  }
  // An example force does work, yet only as much as the pull to the example has to give; without one nothing may gain.
  EXPECT_LE(highest, (examples || integrator == Integrator::kNewmark ? 1.01 : 1 + 1e-9) * energy);
  // 1e-12 of what adds up: the momentum of each vertex.
  VertexArray x, velocity;
  body.vertices(state, x, velocity);
  const double momentum = body.bar.model.rigid->mass * velocity.rowwise().norm().mean();
  const auto last = body.totals(state);
  EXPECT_LE((last.linear - first.linear).norm(), 1e-12 * momentum);
  EXPECT_LE((last.angular - first.angular).norm(), 1e-12 * momentum * body.bar.length);
  const Eigen::Vector3d way = steps * time_step * first.linear / body.bar.model.rigid->mass;
  EXPECT_LE((last.centre - first.centre - way).norm(), 1e-11 * way.norm());
}

// A second of it: 10,000 steps.
TEST(FreeFlight, NewmarkKeepsTheEnergy) {
  const FreeBody body;
  const StepScene scene = body.scene(1e-4, Integrator::kNewmark);
  for (const double spin : {10.0, 100.0}) {
    State state = body.moving(spin, 0.02);
    Workspace workspace(*body.model, scene);
    const double energy = total(body, scene, state);
    double drift = 0;
    for (int i = 0; i < 10000; ++i) {
      step(*body.model, scene, state, workspace);
      drift = std::max(drift, std::abs(total(body, scene, state) - energy));
    }
    EXPECT_LE(drift, 1e-3 * energy) << spin;
  }
}

// With all modes in the basis the moving frame is only another description of the full space: what differs is the
// integrator's own error, of second order.
TEST(FreeFlight, OfAllModesIsTheFullSpace) {
  test::BarOptions options{.cells = {3, 1, 1}, .free = true};
  options.linear_modes = 3 * 4 * 2 * 2 - 6;
  const FreeBody body(options);
  constexpr double kTime = 0.2;
  const State start = body.moving(20, 0.02);
  VertexArray x, velocity;
  body.vertices(start, x, velocity);
  const Eigen::VectorXd expected = test::runge_kutta_positions(body.bar, x.reshaped<Eigen::RowMajor>(),
                                                               velocity.reshaped<Eigen::RowMajor>(), kTime, 4000);
  for (const Integrator integrator : {Integrator::kNewmark, Integrator::kBdf2}) {
    std::vector<double> errors;
    for (const int steps : {400, 800}) {
      StepScene scene = body.scene(kTime / steps, integrator);
      scene.newton.tolerance = 1e-10;
      State state = start;
      Workspace workspace(*body.model, scene);
      for (int i = 0; i < steps; ++i) step(*body.model, scene, state, workspace);
      body.vertices(state, x, velocity);
      errors.push_back((x.reshaped<Eigen::RowMajor>() - expected).lpNorm<Eigen::Infinity>());
    }
    EXPECT_LE(errors[1], 5e-3 * body.bar.length);
    EXPECT_NEAR(errors[0] / errors[1], 4, 0.8);
  }
}

/// Centre of mass and the rotation that fits rest to x best in the mass: that of the mean-axis frame.
struct Placement {
  Eigen::Vector3d centre;
  Eigen::Matrix3d rotation;
  VertexArray deformation;  ///< R^T (x - centre) - X
};

Placement placement(const FreeBody& body, const VertexArray& x) {
  const Eigen::Index n = x.rows();
  const Eigen::MatrixXd mass = body.bar.mass(Eigen::seqN(0, n, 3), Eigen::seqN(0, n, 3));
  const VertexArray X =
      body.bar.model.object->mesh.vertices.rowwise() - body.bar.model.rigid->centre_of_mass.transpose();
  Placement placement;
  placement.centre = (mass * x).colwise().sum().transpose() / mass.sum();
  const VertexArray centred = x.rowwise() - placement.centre.transpose();
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(centred.transpose() * mass * X,
                                              Eigen::ComputeFullU | Eigen::ComputeFullV);
  placement.rotation = svd.matrixU() * svd.matrixV().transpose();
  placement.deformation = centred * placement.rotation - X;
  return placement;
}

// A soft bar that starts to spin: the centre of mass is exact, rotation and deformation come nearer as modes are added.
// The figures are in docs/step_in_detail.md.
TEST(FreeFlight, ComesNearerToTheFullSpaceWithMoreModes) {
  constexpr double kTime = 0.2, kSpin = 10;
  constexpr int kSteps = 2000;
  std::vector<double> turns, deformations;
  Placement expected;
  for (const int modes : {6, 12, 24, 48}) {
    test::BarOptions options{.free = true};
    options.linear_modes = modes;
    const FreeBody body(options);
    State state = body.moving(kSpin, 0);
    VertexArray x, velocity;
    if (turns.empty()) {
      body.vertices(state, x, velocity);
      const Eigen::VectorXd end = test::runge_kutta_positions(body.bar, x.reshaped<Eigen::RowMajor>(),
                                                              velocity.reshaped<Eigen::RowMajor>(), kTime, kSteps);
      expected = placement(body, end.reshaped<Eigen::RowMajor>(x.rows(), 3));
    }
    const StepScene scene = body.scene(kTime / kSteps, Integrator::kNewmark);
    Workspace workspace(*body.model, scene);
    for (int i = 0; i < kSteps; ++i) step(*body.model, scene, state, workspace);
    body.vertices(state, x, velocity);
    const Placement found = placement(body, x);
    // 1e-12 of the numbers that it is the mean of.
    EXPECT_LE((found.centre - expected.centre).norm(), 1e-12 * x.rowwise().norm().maxCoeff());
    turns.push_back(Eigen::AngleAxisd(found.rotation.transpose() * expected.rotation).angle());
    deformations.push_back((found.deformation - expected.deformation).norm() / expected.deformation.norm());
    RecordProperty("rotation_error_r" + std::to_string(modes), std::to_string(turns.back()));
    RecordProperty("deformation_error_r" + std::to_string(modes), std::to_string(deformations.back()));
  }
  for (std::size_t i = 1; i < turns.size(); ++i) EXPECT_LT(deformations[i], deformations[i - 1]) << i;
}

// Euler's equations of the torque-free top: spin about the middle axis flips with the period 4 K(k) / nu of Jacobi's
// elliptic functions (Landau and Lifshitz, Mechanics, section 37).
TEST(FreeFlight, OfAStiffBodyIsEulersTop) {
  const FreeBody body({.lengths = {1.0, 0.5, 0.25}, .youngs_modulus = 1e11, .free = true});
  StepScene scene = body.scene(1e-3, Integrator::kNewmark);
  State state = make_state(*body.model);
  const Eigen::Vector3d J = body.bar.model.rigid->inertia.diagonal();  // along x, y, z: the smallest one along x
  FrameMotion motion;
  motion.angular_velocity = Eigen::Vector3d(0.05, 10, 0.1);
  set_motion(*body.model, motion, state);

  const Eigen::Vector3d w = motion.angular_velocity;
  const double twice_energy = J.dot(w.cwiseAbs2()), momentum = J.cwiseAbs2().dot(w.cwiseAbs2());
  double I1 = J.minCoeff(), I3 = J.maxCoeff(), I2 = J.sum() - I1 - I3;
  if (momentum < twice_energy * I2) std::swap(I1, I3);
  const double nu = std::sqrt((I3 - I2) * (momentum - twice_energy * I1) / (I1 * I2 * I3));
  const double k = std::sqrt((I2 - I1) * (twice_energy * I3 - momentum) / ((I3 - I2) * (momentum - twice_energy * I1)));
  const double period = 4 * std::comp_ellint_1(k) / std::abs(nu);

  Workspace workspace(*body.model, scene);
  std::vector<double> flips;  // times at which the spin about the middle axis changes its sign
  double before = w[1];
  while (flips.size() < 5 && state.time < 60) {
    step(*body.model, scene, state, workspace);
    const double now = free_state(state).spin[1];
    if (before * now < 0) flips.push_back(state.time - scene.time_step * now / (now - before));
    before = now;
  }
  ASSERT_EQ(flips.size(), 5U);
  EXPECT_NEAR((flips[4] - flips[0]) / 2, period, 0.01 * period);
}

TEST(FreeFlight, FallsAsItShouldAndTurnsUnderAForceOffCentre) {
  const FreeBody body;
  StepScene scene = body.scene(1e-3, Integrator::kBdf2);
  scene.gravity = Eigen::Vector3d(0, 0, -9.81);
  State state = make_state(*body.model);
  Workspace workspace(*body.model, scene);
  for (int i = 0; i < 1000; ++i) step(*body.model, scene, state, workspace);
  EXPECT_NEAR(free_state(state).position[2], -9.81 / 2, 1e-11);
  EXPECT_LE(state.q.norm(), 1e-12);

  // A force on one vertex: momentum and angular momentum grow by its integral.
  const Eigen::Index vertex = body.bar.model.object->mesh.vertex_count() - 1;
  const Eigen::Vector3d X =
      body.bar.model.object->mesh.vertices.row(vertex).transpose() - body.bar.model.rigid->centre_of_mass;
  ScriptedForce push;
  push.end = 1e-3;
  push.total = Eigen::Vector3d(0, 3, 0);
  push.lever = X;
  push.mean_basis = body.bar.basis().middleRows<3>(3 * vertex);
  scene.gravity.setZero();
  scene.forces = {push};
  State pushed = make_state(*body.model);
  step(*body.model, scene, pushed, workspace);
  EXPECT_LE((free_state(pushed).linear_momentum - 1e-3 * push.total).norm(), 1e-15);
  EXPECT_LE((free_state(pushed).angular_momentum - 1e-3 * X.cross(push.total)).norm(), 1e-15);
}

TEST(FreeFlight, AllocatesNothing) {
  const FreeBody body;
  for (const double spin : {10.0, 100.0})  // by Cholesky, and with the gyroscopic part
    for (const Integrator integrator : {Integrator::kBdf2, Integrator::kNewmark}) {
      const StepScene scene = body.scene(2e-3, integrator);
      State state = body.moving(spin, 0.02);
      Workspace workspace(*body.model, scene);
      const test::AllocationCounter counter;
      for (int i = 0; i < 5; ++i) step(*body.model, scene, state, workspace);
      EXPECT_EQ(counter.count(), 0U) << spin;
    }
}

TEST(FreeFlight, ATurnOfManyRoundsInAStepIsThatOfARigidBody) {
  const FreeBody body;
  const Eigen::Vector3d J = body.bar.model.rigid->inertia.diagonal();
  const double dt = 1.0 / 30;
  for (int axis = 0; axis < 3; ++axis)
    for (const double spin : {0.0, 1.0, 1e3, 1e5}) {
      State state = make_state(*body.model);
      FrameMotion motion;
      motion.angular_velocity = spin * Eigen::Vector3d::Unit(axis);
      set_motion(*body.model, motion, state);
      const DeformingInertia inertia(*body.bar.model.rigid);
      FreeMotionWorkspace workspace(inertia);
      begin_rotation(free_state(state), dt, true, workspace);
      turn_rigidly(inertia, state.q, state.v, dt, workspace);
      const Eigen::Matrix3d turn(Eigen::AngleAxisd(spin * dt, Eigen::Vector3d::Unit(axis)));
      // Rounding of the angle, that of 1e-16 L about the other axes a thousand times.
      EXPECT_LE((rotation_of(workspace.solution.rotation) - turn).norm(), 1e-12 * (1 + spin * dt)) << axis << spin;
      EXPECT_LE((workspace.turned_momentum - spin * J[axis] * Eigen::Vector3d::Unit(axis)).norm(),
                1e-12 * spin * J[axis]);
    }
}

// Time steps of 30 to 3000 rad.
TEST(FreeFlight, NoSpinIsTooFast) {
  const FreeBody body;
  for (const double spin : {1e3, 1e5})
    for (const Integrator integrator : {Integrator::kBdf2, Integrator::kBackwardEuler, Integrator::kNewmark}) {
      const StepScene scene = body.scene(1.0 / 30, integrator);
      State state = body.moving(spin, 0.02);
      const Eigen::Vector3d momentum = free_state(state).angular_momentum;
      double energy = energies(*body.model, scene, state).kinetic + state.elastic_energy;
      Workspace workspace(*body.model, scene);
      const test::AllocationCounter counter;
      for (int i = 0; i < 30; ++i) {
        const StepReport report = step(*body.model, scene, state, workspace);
        ASSERT_FALSE(report.status & kStepNonFinite) << spin << " step " << i;
      }
      EXPECT_EQ(counter.count(), 0U);
      EXPECT_LE(energies(*body.model, scene, state).kinetic + state.elastic_energy, energy) << spin;
      EXPECT_LE((free_state(state).angular_momentum - momentum).norm(), 1e-14 * momentum.norm());
    }
}

// Once the factor of an iteration was of a slow spin and the next one's was fast, the series for it never ended; and a
// step along an ascending direction was taken unchecked.
TEST(FreeFlight, ABodyOfRandomShapeKeepsItsEnergyByBackwardEuler) {
  for (const MaterialModel material : {MaterialModel::kStableNeoHookean, MaterialModel::kCorotational}) {
    const FreeBody body({.material = material, .free = true});
    for (const double time_step : {1e-3, 1.0 / 30})
      for (std::uint32_t seed = 1; seed <= 5; ++seed) {
        const StepScene scene = body.scene(time_step, Integrator::kBackwardEuler);
        State state = body.moving(1, 5, seed);
        const double energy = energies(*body.model, scene, state).kinetic + state.elastic_energy;
        Workspace workspace(*body.model, scene);
        for (int i = 0; i < 100; ++i) {
          ASSERT_FALSE(step(*body.model, scene, state, workspace).status & kStepNonFinite) << seed << " step " << i;
          ASSERT_LE(energies(*body.model, scene, state).kinetic + state.elastic_energy, energy * (1 + 1e-9))
              << seed << " " << i;
        }
      }
  }
}

// Example forces are internal, however strong.
TEST(FreeFlight, StrongExampleForcesKeepTheMomenta) {
  const FreeBody body;
  for (const double stiffness : {1e2, 1e4, 1e6, 1e8}) {
    StepScene scene = body.scene(1e-3, Integrator::kBdf2);
    scene.examples = {ExampleSettings{stiffness, 0, 0.3, 4}};
    State state = body.moving(10, 0.02);
    Workspace workspace(*body.model, scene);
    const Eigen::Vector3d linear = free_state(state).linear_momentum, angular = free_state(state).angular_momentum;
    for (int i = 0; i < 1000; ++i)
      ASSERT_FALSE(step(*body.model, scene, state, workspace).status & kStepNonFinite) << stiffness;
    EXPECT_EQ(free_state(state).linear_momentum, linear);
    EXPECT_EQ(free_state(state).angular_momentum, angular);
    EXPECT_LE((body.bar.basis() * state.q).lpNorm<Eigen::Infinity>(), body.bar.length) << stiffness;
  }
}

}  // namespace free_flight_test
}  // namespace exmat::runtime
