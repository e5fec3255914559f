#include "runtime/sim/frame/carried_motion.h"

#include <cmath>
#include <gtest/gtest.h>
#include <vector>

#include "common/core/decompositions.h"
#include "runtime/sim/step/stepper.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/random.h"
#include "tests/support/synthetic_model.h"

namespace exmat::runtime {
namespace {

using test::Bar;

constexpr double kKey = 0.1;  // [s] from key to key

/// Swings and turns by 1.6 rad within two keys, then stands.
RigidMotion swing() {
  const Eigen::Vector3d axis = Eigen::Vector3d(0.4, -0.3, 0.8).normalized();
  const auto turned = [&](double angle) { return Eigen::Quaterniond(Eigen::AngleAxisd(angle, axis)); };
  return RigidMotion(std::vector<Keyframe>{{0, Eigen::Vector3d::Zero(), turned(0)},
                                           {kKey, Eigen::Vector3d(0.1, 0.2, -0.1), turned(0.9)},
                                           {2 * kKey, Eigen::Vector3d(-0.1, 0.3, 0.2), turned(1.6)}});
}

struct CarriedBar {
  explicit CarriedBar(test::BarOptions options = {}) {
    options.carried = true;
    bar = test::make_bar(options);
    model = build_model(bar.model, {.carried = true}).model;
  }

  StepScene scene(double time_step, Integrator integrator) const {
    StepScene scene;
    scene.time_step = time_step;
    scene.integrator = integrator;
    scene.gravity = Eigen::Vector3d(0, -9.81, 2);
    scene.gravity_force = gravity_force(*model, scene.gravity);
    scene.carrier = swing();
    return scene;
  }

  State start(const StepScene& scene, const Eigen::VectorXd& q, const Eigen::VectorXd& v) const {
    State state = make_state(*model, q, v);
    Workspace workspace(*model, scene);
    follow_frame(*model, scene, state, workspace);
    return state;
  }

  /// World positions and velocities of all vertices, interleaved.
  Eigen::VectorXd positions(const State& state) const {
    Eigen::VectorXd x = rest() + bar.basis() * state.q;
    const Placement placement = model->frame->placement(state.frame);
    for (Eigen::Index i = 0; i < x.size(); i += 3)
      x.segment<3>(i) = placement.to_world(Eigen::Vector3d(x.segment<3>(i)));
    return x;
  }
  Eigen::VectorXd velocities(const State& state) const {
    const Eigen::VectorXd x = positions(state);
    Eigen::VectorXd velocity = bar.basis() * state.v;
    const MotionSample frame = swing().sample(state.time);
    for (Eigen::Index i = 0; i < x.size(); i += 3)
      velocity.segment<3>(i) =
          frame.velocity_at(x.segment<3>(i)) + frame.rotation * Eigen::Vector3d(velocity.segment<3>(i));
    return velocity;
  }
  Eigen::VectorXd rest() const { return bar.model.object->mesh.vertices.reshaped<Eigen::RowMajor>(); }

  Bar bar;
  std::unique_ptr<const Model> model;
};

/// All vertices in the world by the classical Runge-Kutta method: M_ff x_f'' = M_f g - f_int - M_fc x_c'', the clamped
/// ones on their way.
Eigen::VectorXd full_space_positions(const CarriedBar& carried, const StepScene& scene, Eigen::VectorXd x,
                                     Eigen::VectorXd v, double time, int steps) {
  const Bar& bar = carried.bar;
  const Eigen::VectorXd rest = carried.rest();
  std::vector<Eigen::Index> free, clamped;
  for (Eigen::Index i = 0; i < rest.size(); ++i) (bar.model.object->fixed[i / 3] != 0 ? clamped : free).push_back(i);
  const Eigen::LLT<Eigen::MatrixXd> mass(bar.mass(free, free));
  const Eigen::MatrixXd coupling = bar.mass(free, clamped);
  const Eigen::VectorXd weight = bar.mass * scene.gravity.replicate(rest.size() / 3, 1);
  // Just after `at` where a step begins, just before it where it ends: accelerations jump at keys.
  const auto acceleration = [&](Eigen::VectorXd positions, double at, double side) {
    const MotionSample frame = scene.carrier->sample(at + side * 1e-9);
    Eigen::VectorXd pull(rest.size());
    for (Eigen::Index i = 0; i < rest.size(); i += 3) {
      const Eigen::Vector3d arm = frame.rotation * rest.segment<3>(i), &w = frame.angular_velocity;
      if (bar.model.object->fixed[i / 3] != 0) positions.segment<3>(i) = frame.position + arm;
      pull.segment<3>(i) = frame.linear_acceleration + frame.angular_acceleration.cross(arm) + w.cross(w.cross(arm));
    }
    const Eigen::VectorXd force = weight - test::full_internal_force(bar, positions - rest);
    Eigen::VectorXd result = Eigen::VectorXd::Zero(rest.size());
    const Eigen::VectorXd solved = mass.solve(force(free) - coupling * pull(clamped));
    result(free) = solved;
    return result;
  };
  const double h = time / steps;
  for (int i = 0; i < steps; ++i) {
    const double t = i * h;
    const Eigen::VectorXd a1 = acceleration(x, t, 1), v2 = v + h / 2 * a1;
    const Eigen::VectorXd a2 = acceleration(x + h / 2 * v, t + h / 2, 0), v3 = v + h / 2 * a2;
    const Eigen::VectorXd a3 = acceleration(x + h / 2 * v2, t + h / 2, 0), v4 = v + h * a3;
    const Eigen::VectorXd a4 = acceleration(x + h * v3, t + h, -1);
    x += h / 6 * (v + 2 * v2 + 2 * v3 + v4);
    v += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
  }
  for (const Eigen::Index i : clamped) x[i] = scene.carrier->sample(time).to_world(rest.segment<3>(i - i % 3))[i % 3];
  return x;
}

// With all modes in the basis the moving frame is only another description of the full space.
TEST(CarriedMotion, OfAllModesIsTheFullSpace) {
  test::BarOptions options{.cells = {3, 1, 1}, .density_gradient = 0.5};
  options.linear_modes = 3 * 3 * 4;
  const CarriedBar carried(options);
  constexpr double kTime = 0.3;
  const StepScene any = carried.scene(1e-3, Integrator::kNewmark);
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(carried.model->modes());
  const State start = carried.start(any, zero, zero);
  const Eigen::VectorXd rest = carried.rest();
  const Eigen::VectorXd expected =
      full_space_positions(carried, any, carried.positions(start), Eigen::VectorXd::Zero(rest.size()), kTime, 3000);
  for (const Integrator integrator : {Integrator::kNewmark, Integrator::kBdf2}) {
    std::vector<double> errors;
    for (const int steps : {600, 1200}) {
      StepScene scene = carried.scene(kTime / steps, integrator);
      scene.newton.tolerance = 1e-10;
      State state = start;
      Workspace workspace(*carried.model, scene);
      for (int i = 0; i < steps; ++i) step(*carried.model, scene, state, workspace);
      errors.push_back((carried.positions(state) - expected).lpNorm<Eigen::Infinity>());
    }
    EXPECT_LE(errors[1], 2e-3 * carried.bar.length);
    EXPECT_NEAR(errors[0] / errors[1], 4, 0.8);
  }
}

TEST(CarriedMotion, EnergiesAreThoseOfTheVertices) {
  const CarriedBar carried;
  StepScene scene = carried.scene(1e-3, Integrator::kBdf2);
  const Eigen::VectorXd q = 0.2 * test::random_vector(carried.model->modes(), 1);
  State state = carried.start(scene, q, 30 * q);
  Workspace workspace(*carried.model, scene);
  for (int i = 0; i < 57; ++i) step(*carried.model, scene, state, workspace);
  const Eigen::VectorXd x = carried.positions(state), v = carried.velocities(state), rest = carried.rest();
  const Eigen::VectorXd down = scene.gravity.replicate(rest.size() / 3, 1);
  const Energies now = energies(*carried.model, scene, state);
  const double kinetic = 0.5 * v.dot(carried.bar.mass * v);
  EXPECT_NEAR(now.kinetic, kinetic, 1e-12 * kinetic);
  EXPECT_NEAR(now.potential, -down.dot(carried.bar.mass * (x - rest)), 1e-10 * std::abs(now.potential));
}

// Fast turns take the gyroscopic part by a factorisation, slow ones by a series.
TEST(CarriedMotion, StaysFiniteAndConvergesAtAnySpeed) {
  const CarriedBar carried;
  for (const double speed : {0.1, 1.0, 10.0, 100.0}) {
    const double time_step = 1e-3;
    StepScene scene = carried.scene(time_step, Integrator::kBdf2);
    const Eigen::Quaterniond turn(Eigen::AngleAxisd(1, Eigen::Vector3d::UnitZ()));
    std::vector<Keyframe> keys;
    for (int i = 0; i < 6; ++i)
      keys.push_back({i / speed, Eigen::Vector3d::Zero(),
                      keys.empty() ? Eigen::Quaterniond::Identity() : keys.back().orientation * turn});
    scene.carrier = RigidMotion(keys);
    scene.mass_damping = 1;
    const Eigen::VectorXd zero = Eigen::VectorXd::Zero(carried.model->modes());
    State state = carried.start(scene, zero, zero);
    Workspace workspace(*carried.model, scene);
    for (int i = 0; i < 200; ++i) {
      const StepReport report = step(*carried.model, scene, state, workspace);
      ASSERT_EQ(report.status & (kStepNonFinite | kStepIterationLimit), 0U) << speed << " " << i;
    }
    EXPECT_TRUE(state.q.allFinite());
  }
}

// A bar that is pressed onto a floor bends as one that the floor is pressed against.
TEST(CarriedMotion, OntoAFloorIsAFloorOntoTheBody) {
  Eigen::VectorXd at_end[2];
  for (const bool floor_moves : {false, true}) {
    test::BarOptions options;
    options.carried = !floor_moves;
    Bar bar = test::make_bar(options);
    bar.model.contact = test::surface_contact(bar.model);
    const auto model = build_model(bar.model, {.carried = !floor_moves}).model;
    StepScene scene;
    scene.time_step = 2e-3;
    scene.mass_damping = 5;
    scene.newton.tolerance = 1e-10;
    scene.stiffness_damping = 0.01;
    scene.gravity_force = Eigen::VectorXd::Zero(model->modes());
    const Eigen::Vector3d way(0, 0, floor_moves ? 0.1 : -0.1);
    const RigidMotion motion(std::vector<Keyframe>{{0, Eigen::Vector3d::Zero()}, {0.2, way}});
    const double bottom = bar.model.object->mesh.vertices.col(2).minCoeff();
    scene.obstacles.push_back(Obstacle{Plane{Eigen::Vector3d(0, 0, bottom - 0.02), Eigen::Vector3d::UnitZ()},
                                       floor_moves ? motion : RigidMotion(), 1e6, 0, 0});
    State state = make_state(*model);
    prepare_contacts(*model, 1, state);
    if (!floor_moves) scene.carrier = motion;
    Workspace workspace(*model, scene);
    follow_frame(*model, scene, state, workspace);
    for (int i = 0; i < 4000; ++i) step(*model, scene, state, workspace);
    at_end[floor_moves ? 1 : 0] = state.q;
  }
  EXPECT_GT(at_end[0].norm(), 0.01);
  // 1e-6: what is left of the motion after 8 s of damping.
  EXPECT_LE((at_end[0] - at_end[1]).norm(), 1e-6 * at_end[0].norm());
}

TEST(CarriedMotion, AllocatesNothing) {
  const CarriedBar carried;
  for (const Integrator integrator : {Integrator::kBdf2, Integrator::kNewmark}) {
    const StepScene scene = carried.scene(1e-3, integrator);
    const Eigen::VectorXd zero = Eigen::VectorXd::Zero(carried.model->modes());
    State state = carried.start(scene, zero, zero);
    Workspace workspace(*carried.model, scene);
    const test::AllocationCounter counter;
    for (int i = 0; i < 150; ++i) step(*carried.model, scene, state, workspace);
    EXPECT_EQ(counter.count(), 0U);
  }
}

TEST(CarriedMotion, NeedsItsMoments) {
  const Bar bar = test::make_bar();
  EXPECT_EQ(build_model(bar.model, {.carried = true}).complaint.place, "/rigid/spin_load");
}

}  // namespace
}  // namespace exmat::runtime
