#include <Eigen/Geometry>
#include <cmath>
#include <gtest/gtest.h>
#include <limits>
#include <numbers>
#include <vector>

#include "common/core/error.h"
#include "tests/precompute/full_space/full_space_bar.h"
#include "tests/support/box_mesh.h"
#include "tests/support/random.h"
#include "tests/support/sparse_space/step_potential.h"

namespace exmat::precompute {
namespace {

constexpr std::array kIntegrators{Integrator::kBdf2, Integrator::kBackwardEuler, Integrator::kNewmark};

/// A free bar of a few tets that spins, flies and vibrates.
struct FreeBar {
  explicit FreeBar(const test::BarOptions& options = {.cells = {3, 1, 1}, .free = true, .linear_modes = 8})
      : bar(test::make_bar(options)), model(build_sparse_model(bar.model, targets_of(options))) {}

  FullSpaceState moving(double spin) const {
    const Eigen::VectorXd first = bar.basis().col(0) + 0.3 * bar.basis().col(3);
    runtime::FrameMotion motion;
    motion.position = Eigen::Vector3d(1, 2, 3);
    motion.orientation = Eigen::Quaterniond(0.5, 0.1, -0.7, 0.3).normalized();
    motion.linear_velocity = Eigen::Vector3d(1, -2, 0.5);
    motion.angular_velocity = spin * Eigen::Vector3d(0.3, 0.9, 0.2).normalized();
    return make_full_space_state(model, 0.02 * bar.length / first.lpNorm<Eigen::Infinity>() * first, motion);
  }
  FullSpaceState after(const FullSpaceScene& scene, double spin, int steps) const {
    FullSpaceState state = moving(spin);
    run(model, scene, state, steps);
    return state;
  }
  Eigen::VectorXd positions(const FullSpaceState& state) const {
    return world_positions(model, state).reshaped<Eigen::RowMajor>();
  }

  Eigen::Vector3d linear_momentum(const FullSpaceState& state) const {
    return model.gravity_load.transpose() * state.v;
  }
  /// About the world's origin: of the whole motion, that of the centre of mass included.
  Eigen::Vector3d angular_momentum(const FullSpaceState& state) const {
    const Eigen::VectorXd x = positions(state), p = model.system.mass * state.v;
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (Eigen::Index i = 0; i < x.size(); i += 3)
      sum += Eigen::Vector3d(x.segment<3>(i)).cross(Eigen::Vector3d(p.segment<3>(i)));
    return sum;
  }

  test::Bar bar;
  SparseModel model;
};

double total_energy(const SparseModel& model, const FullSpaceScene& scene, const FullSpaceState& state) {
  return energies(model, scene, state).total();
}

FullSpaceScene scene_of(Integrator integrator, double time_step) {
  FullSpaceScene scene;
  scene.integrator = integrator;
  scene.time_step = time_step;
  scene.newton.tolerance = 1e-10;
  return scene;
}

TEST(FullSpace, ConvergesInTheTimeStepWithTheOrderOfTheIntegrator) {
  const FreeBar body;
  constexpr double kTime = 0.1, kSpin = 20;
  const FullSpaceState start = body.moving(kSpin);
  // Its own error is of the fourth order in a step forty times as short.
  const Eigen::VectorXd expected = test::runge_kutta_positions(body.bar, body.positions(start), start.v, kTime, 4000);
  for (const Integrator integrator : kIntegrators) {
    std::vector<double> errors;
    for (const int steps : {200, 400}) {
      const FullSpaceState end = body.after(scene_of(integrator, kTime / steps), kSpin, steps);
      errors.push_back((body.positions(end) - expected).lpNorm<Eigen::Infinity>());
    }
    const double order = integrator == Integrator::kBackwardEuler ? 1 : 2;
    EXPECT_NEAR(std::log2(errors[0] / errors[1]), order, 0.15) << static_cast<int>(integrator);
    EXPECT_GT(errors[1], 1e-8) << "nothing to see";
  }
}

// Forces between vertices add up to nothing: every integrator keeps the linear momentum, to Newton's tolerance. Of the
// angular momentum each loses what its order says.
TEST(FullSpace, KeepsLinearMomentumAndAngularMomentumToItsOrder) {
  const FreeBar body;
  constexpr double kTime = 0.1, kSpin = 20;
  for (const Integrator integrator : kIntegrators) {
    std::vector<double> errors;
    for (const int steps : {200, 400}) {
      const FullSpaceState start = body.moving(kSpin);
      const FullSpaceState end = body.after(scene_of(integrator, kTime / steps), kSpin, steps);
      const Eigen::Vector3d p = body.linear_momentum(start), L = body.angular_momentum(start);
      EXPECT_LE((body.linear_momentum(end) - p).norm(), 1e-8 * p.norm());
      errors.push_back((body.angular_momentum(end) - L).norm() / L.norm());
    }
    const double order = integrator == Integrator::kBackwardEuler ? 1 : 2;
    EXPECT_NEAR(std::log2(errors[0] / errors[1]), order, 0.15) << static_cast<int>(integrator);
  }
}

/// Energies in ten periods of a bar that is let go, over the first one.
std::vector<double> energies_of_vibration(Integrator integrator, int steps_per_period) {
  const test::Bar bar = test::make_bar({.cells = {4, 1, 1}});
  const SparseModel model = build_sparse_model(bar.model);
  const Eigen::VectorXd bent = 0.03 * bar.length / bar.basis().col(0).lpNorm<Eigen::Infinity>() * bar.basis().col(0);
  const FullSpaceScene scene = scene_of(integrator, 1 / (steps_per_period * bar.model.modal->frequencies[0]));
  FullSpaceState state = make_full_space_state(model, bent, Eigen::VectorXd::Zero(bent.size()));
  SparseWorkspace workspace(model);
  const double start = total_energy(model, scene, state);
  std::vector<double> found;
  for (int i = 0; i < 10 * steps_per_period; ++i) {
    EXPECT_EQ(step(model, scene, state, workspace).status, 0U);
    found.push_back(total_energy(model, scene, state) / start);
  }
  return found;
}

double largest_drift(std::vector<double>::const_iterator from, std::vector<double>::const_iterator to) {
  double drift = 0;
  for (; from != to; ++from) drift = std::max(drift, std::abs(*from - 1));
  return drift;
}

// Exact for a linear body; for this one of second order in the step, and not more after ten periods than after five.
TEST(FullSpace, NewmarkKeepsTheEnergyOfAVibration) {
  std::vector<double> drifts;
  for (const int steps : {60, 120}) {
    const std::vector<double> found = energies_of_vibration(Integrator::kNewmark, steps);
    const auto half = found.begin() + std::ssize(found) / 2;
    drifts.push_back(largest_drift(found.begin(), found.end()));
    EXPECT_LE(largest_drift(half, found.end()), 1.2 * largest_drift(found.begin(), half));
    RecordProperty("drift_" + std::to_string(steps), std::to_string(drifts.back()));
  }
  EXPECT_LE(drifts[1], 5e-3);
  EXPECT_NEAR(std::log2(drifts[0] / drifts[1]), 2, 0.5);
}

TEST(FullSpace, BackwardEulerNeverGainsEnergy) {
  const std::vector<double> found = energies_of_vibration(Integrator::kBackwardEuler, 60);
  // 1e-9: Newton's tolerance.
  for (std::size_t i = 1; i < found.size(); ++i) ASSERT_LE(found[i], found[i - 1] + 1e-9) << i;
  EXPECT_LE(found.back(), 0.1) << "nothing to see";
}

/// Deflection of the end of a cantilever of square section under a small load there, spread over the end's vertices as
/// a constant shear would be.
double deflection(int along, double length, double width, double youngs_modulus, double load) {
  const int across = along / 4;
  ReducedModel model;
  ObjectData& object = model.object.emplace();
  object.mesh = test::box_mesh({along, across, across}, {length, width, width});
  const Eigen::Index tets = object.mesh.tet_count();
  object.materials = {Eigen::VectorXd::Constant(tets, 1000), Eigen::VectorXd::Constant(tets, youngs_modulus),
                      Eigen::VectorXd::Zero(tets)};
  object.fixed = (object.mesh.vertices.col(0).array() < 1e-9).cast<std::uint8_t>();
  const SparseModel full = build_sparse_model(model);
  FullSpaceScene scene = scene_of(Integrator::kBackwardEuler, 1e6);  // statics
  std::vector<std::int64_t> end;
  std::vector<double> shares;
  for (Eigen::Index i = 0; i < object.mesh.vertex_count(); ++i) {
    const auto x = object.mesh.vertices.row(i);
    if (x[0] < length - 1e-9) continue;
    double share = 1.0 / (across * across);
    for (int axis = 1; axis < 3; ++axis)
      if (x[axis] < 1e-9 || x[axis] > width - 1e-9) share /= 2;
    scene.forces.push_back({{i}, Eigen::Vector3d(0, 0, load * share)});
    end.push_back(i);
    shares.push_back(share);
  }
  FullSpaceState state = at_rest(full);
  run(full, scene, state, 1);
  double mean = 0;
  for (std::size_t i = 0; i < end.size(); ++i) mean += shares[i] * full.system.extend(state.q)(3 * end[i] + 2);
  return mean;
}

// Linear tets are too stiff by a share of second order in their size. What is left after Richardson's extrapolation is
// that beam theory has no edges at its clamp.
TEST(FullSpace, ConvergesInTheElementSizeToTimoshenkosBeam) {
  constexpr double kLength = 1, kWidth = 0.2, kYoung = 1e6, kLoad = 1e-4;
  const double area = kWidth * kWidth, inertia = std::pow(kWidth, 4) / 12, shear = kYoung / 2;
  const double compliance =
      std::pow(kLength, 3) / (3 * kYoung * inertia) + kLength / (5.0 / 6 * shear * area);  // Timoshenko 1921
  std::vector<double> stiffness;
  for (const int along : {8, 16, 32}) stiffness.push_back(kLoad / deflection(along, kLength, kWidth, kYoung, kLoad));
  const double order = std::log2((stiffness[0] - stiffness[1]) / (stiffness[1] - stiffness[2]));
  const double limit = stiffness[2] - (stiffness[1] - stiffness[2]) / 3;
  RecordProperty("order", std::to_string(order));
  RecordProperty("limit_times_compliance", std::to_string(limit * compliance));
  EXPECT_NEAR(order, 2, 0.1);
  EXPECT_NEAR(limit * compliance, 1, 0.005);
}

TEST(FullSpace, ReportsWhatIsNotFiniteAndKeepsTheState) {
  const test::Bar bar = test::make_bar({.cells = {2, 1, 1}});
  const SparseModel model = build_sparse_model(bar.model);
  FullSpaceState state = at_rest(model);
  state.applied_force[3] = std::numeric_limits<double>::quiet_NaN();
  SparseWorkspace workspace(model);
  EXPECT_TRUE(step(model, scene_of(Integrator::kBdf2, 0.01), state, workspace).status & runtime::kStepNonFinite);
  EXPECT_EQ(state.step, 0);
  EXPECT_TRUE(state.q.isZero());
}

TEST(FullSpace, NamesAMissingGroup) {
  test::Bar bar = test::make_bar({.cells = {2, 1, 1}});
  EXPECT_THROW(build_sparse_model(bar.model, {.whole_body = true}), InputError);
  bar.model.object.reset();
  EXPECT_THROW(build_sparse_model(bar.model), InputError);
}

// A free body in a frame of its own (the run time) and in the world: of second order in the time step they are the
// same, damping and examples included.
TEST(FullSpace, FreeBodiesWithDampingAndExamplesAreThoseOfTheRunTime) {
  test::Bar bar =
      complete_bar({.cells = {2, 1, 1}, .density_gradient = 0.5, .free = true, .eigenfunctions = 3, .examples = 2});
  const auto reduced = runtime::build_model(bar.model, {}).model;
  const SparseModel full = build_sparse_model(bar.model, {.whole_body = true});
  runtime::FrameMotion motion;
  motion.linear_velocity = Eigen::Vector3d(1, 0, -1);
  motion.angular_velocity = Eigen::Vector3d(1, 6, -3);
  constexpr double kTime = 0.1;
  std::vector<double> differences;
  for (const int steps : {100, 200}) {
    runtime::StepScene scene;
    FullSpaceScene full_scene = scene_of(Integrator::kBdf2, kTime / steps);
    scene.time_step = full_scene.time_step;
    scene.newton.tolerance = 1e-10;
    scene.mass_damping = full_scene.mass_damping = 2;
    scene.stiffness_damping = full_scene.stiffness_damping = 1e-3;
    scene.gravity_force = Eigen::VectorXd::Zero(reduced->modes());
    scene.examples = full_scene.examples = {{2000, 10, 0.3}};
    runtime::State state = runtime::make_state(*reduced);
    runtime::set_motion(*reduced, motion, state);
    runtime::Workspace workspace(*reduced, scene);
    FullSpaceState full_state = make_full_space_state(full, Eigen::VectorXd::Zero(full.size()), motion);
    for (int i = 0; i < steps; ++i) runtime::step(*reduced, scene, state, workspace);
    run(full, full_scene, full_state, steps);
    const Eigen::VectorXd u = Deformation(full, full_state.q).u();
    EXPECT_GE(u.lpNorm<Eigen::Infinity>(), 0.01 * bar.length) << "the examples do nothing";
    differences.push_back((u - bar.basis() * state.q).norm() / u.norm());
    EXPECT_NEAR((state.examples.front().weights - full_state.examples.front().weights).norm(), 0, 1e-2);
  }
  EXPECT_LE(differences[1], 1e-2);
  EXPECT_NEAR(std::log2(differences[0] / differences[1]), 2, 0.3);
}

// Example forces and damping are internal.
TEST(FullSpace, ExamplesAndDampingTakeNoMomentum) {
  const FreeBar body({.cells = {3, 1, 1}, .density_gradient = 1, .free = true, .examples = 2});
  FullSpaceScene scene = scene_of(Integrator::kNewmark, 5e-4);
  scene.mass_damping = 5;
  scene.stiffness_damping = 1e-3;
  for (const bool elastic : {false, true}) {
    scene.examples = {{.stiffness = elastic ? 2.0 : 3000.0, .damping = 10, .bias = 0.3, .elastic = elastic}};
    const FullSpaceState start = body.moving(2), end = body.after(scene, 2, 200);
    const Eigen::Vector3d p = body.linear_momentum(start), L = body.angular_momentum(start);
    EXPECT_LE((body.linear_momentum(end) - p).norm(), 1e-8 * p.norm());
    // The integrator's own error, see KeepsLinearMomentumAndAngularMomentumToItsOrder: 1e-6 (spin dt)^2 and the faster
    // vibrations; a force that turned the body would change it by tenths.
    EXPECT_LE((body.angular_momentum(end) - L).norm(), 1e-3 * L.norm());
    EXPECT_LT(end.examples.front().weights[0], 0.9);
  }
}

/// A free block and a floor through the origin.
struct Dropped {
  explicit Dropped(double friction, double slope)
      : bar(test::make_bar({.cells = {2, 1, 1}, .lengths = {0.4, 0.2, 0.2}, .youngs_modulus = 1e6, .free = true})) {
    bar.model.contact = test::surface_contact(bar.model);
    model = build_sparse_model(bar.model);
    scene.time_step = 2e-3;
    // The floor stays level; gravity leans.
    scene.gravity = kGravity * Eigen::Vector3d(std::sin(slope), 0, -std::cos(slope));
    scene.mass_damping = 2;
    scene.stiffness_damping = 2e-3;
    scene.obstacles.push_back(runtime::Obstacle{runtime::Plane{}, {}, 1e7, 2e4, friction});
    state = at_rest(model);
  }
  double mass() const { return model.frame->mass(); }
  double velocity() const { return (model.gravity_load.transpose() * state.v)[0] / mass(); }

  static constexpr double kGravity = 9.81;
  test::Bar bar;
  SparseModel model;
  FullSpaceScene scene;
  FullSpaceState state;
};

TEST(FullSpaceContact, ABodyComesToRestAndTheFloorCarriesIt) {
  Dropped body(0.5, 0);
  run(body.model, body.scene, body.state, 1500);
  SparseWorkspace workspace(body.model);
  const SparseReport report = step(body.model, body.scene, body.state, workspace);
  const double weight = body.mass() * Dropped::kGravity;
  EXPECT_NEAR(report.contact_force[2], weight, 1e-4 * weight);
  EXPECT_GT(report.contacts, 3);
  EXPECT_LE(body.state.v.norm(), 1e-5);
}

TEST(FullSpaceContact, SlidesOrStaysOnASlope) {
  constexpr double kSlope = 20 * std::numbers::pi / 180;
  for (const double friction : {0.2, 0.8}) {
    Dropped body(friction, kSlope);
    run(body.model, body.scene, body.state, 300);
    const double velocity = body.velocity();
    const Eigen::VectorXd place = body.state.q;
    constexpr int kSteps = 300;
    run(body.model, body.scene, body.state, kSteps);
    if (friction > std::tan(kSlope)) {
      EXPECT_LE((body.state.q - place).lpNorm<Eigen::Infinity>(), 1e-5);
    } else {
      const double expected = Dropped::kGravity * (std::sin(kSlope) - friction * std::cos(kSlope));
      EXPECT_NEAR((body.velocity() - velocity) / (kSteps * body.scene.time_step), expected, 0.02 * expected);
    }
  }
}

}  // namespace
}  // namespace exmat::precompute
