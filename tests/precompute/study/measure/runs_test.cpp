#include "precompute/study/measure/runs.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "common/bundle/bundle.h"
#include "common/core/error.h"
#include "precompute/study/measure/error_metrics.h"
#include "precompute/study/measure/timing.h"
#include "tests/precompute/full_space/full_space_bar.h"
#include "tests/support/temporary_folder.h"

namespace exmat::precompute {
namespace {

// A bundle with all modes, and scenes on it.
class Runs : public testing::Test {
 protected:
  void make(const test::BarOptions& options, bool contact = false) {
    bar_ = complete_bar(options);
    if (contact) bar_.model.contact = test::surface_contact(bar_.model);
    write_bundle(bar_.model, folder_ / "bar.h5");
  }
  SceneConfig scene() const {
    SceneConfig config;
    config.file = folder_ / "scene.json";
    config.bundle = folder_ / "bar.h5";
    config.time_step = 0.01;
    config.gravity = {0, -12, 4};
    config.newton = {60, 1e-10};
    config.trajectory = "positions";
    return config;
  }
  TrajectoryErrors errors(const SceneConfig& config, const std::vector<double>& times) {
    reduced_ = run_reduced(config, times);
    full_ = run_full_space(config, bar_.model, times);
    return trajectory_errors(reduced_.frames, full_, bar_.model.object->mesh.vertices,
                             scalar_mass(bar_.model.object->mesh, bar_.model.object->materials.density),
                             bar_.model.rigid.has_value());
  }

  test::TemporaryFolder folder_;
  test::Bar bar_;
  ReducedRun reduced_;
  BodyFrames full_;
};

// The full space solves each step to a residual of 1e-8 of the forces.
TEST_F(Runs, WithAllModesAreTheFullSpace) {
  make({.cells = {2, 1, 1}, .examples = 3});
  SceneConfig config = scene();
  config.mass_damping = 0.5;
  config.examples.emplace();
  config.examples->stiffness = 400;
  config.examples->damping = 2;
  config.examples->bias = 0.5;
  config.examples->target_iterations = 50;
  for (const bool given : {false, true}) {
    if (given) config.examples->weights = Eigen::Vector3d(0.1, 0.7, 0.2);
    const TrajectoryErrors found = errors(config, {0.05, 0.1, 0.2, 0.4});
    EXPECT_LE(found.position.max, 1e-7);
    EXPECT_LE(found.velocity.max, 1e-6);
    EXPECT_LE(found.energy, 1e-6);
  }
  EXPECT_EQ(reduced_.frames.steps, 40);
  EXPECT_EQ(reduced_.modes, static_cast<std::size_t>(bar_.modes()));
  EXPECT_EQ(reduced_.target, "solve");
  EXPECT_EQ(reduced_.frames.unconverged, 0);
  EXPECT_GE(mass_norm(scalar_mass(bar_.model.object->mesh, bar_.model.object->materials.density), full_.velocities[1]),
            0.01)
      << "it does not move";
}

// The two integrate a free body's turn in different ways, to second order in the time step.
TEST_F(Runs, OfAFreeBodyComeNearerToTheFullSpaceWithTheTimeStep) {
  make({.cells = {2, 1, 1}, .free = true});
  SceneConfig config = scene();
  config.body.linear_velocity = Eigen::Vector3d(1, 2, 0);
  config.body.angular_velocity = Eigen::Vector3d(2, -1, 3);
  std::vector<TrajectoryErrors> found;
  for (const double step : {0.001, 0.00025}) {
    config.time_step = step;
    found.push_back(errors(config, {0.08, 0.16}));
  }
  constexpr double kSecondOrder = 1.0 / 13;  // 1 / 16, and a little more while the steps are not endlessly small
  EXPECT_LE(found[1].position.max, kSecondOrder * found[0].position.max);
  EXPECT_LE(found[1].velocity.max, kSecondOrder * found[0].velocity.max);
  EXPECT_LE(found[1].shape.value().max, kSecondOrder * found[0].shape->max);
  EXPECT_LE(found[1].position.max, 1e-5);
}

// Frames are at the same times whatever the steps; with shorter ones the motion comes to that of the shortest, to the
// second order of BDF2.
TEST_F(Runs, OfTheFullSpaceMayTakeOtherSteps) {
  make({.cells = {2, 1, 1}});
  const std::vector<double> times{0.04, 0.08, 0.2};
  std::vector<BodyFrames> runs;
  for (const double step : {0.002, 0.001, 0.000125}) {
    SceneConfig config = scene();
    config.time_step = step;
    runs.push_back(run_full_space(config, bar_.model, times));
    EXPECT_EQ(runs.back().times, times);
    EXPECT_EQ(runs.back().steps, std::llround(0.2 / step));
  }
  const SparseMatrix mass = scalar_mass(bar_.model.object->mesh, bar_.model.object->materials.density);
  const auto error = [&](const BodyFrames& frames) {
    return trajectory_errors(frames, runs.back(), bar_.model.object->mesh.vertices, mass, false).position.mean;
  };
  EXPECT_GT(error(runs[0]), 1e-6) << "nothing to come nearer to";
  // Second order makes (1 - 1/256) / (1/4 - 1/256) = 4.05; steps that are not endlessly small a little less.
  EXPECT_GT(error(runs[0]) / error(runs[1]), 3.5);
  EXPECT_LT(error(runs[0]) / error(runs[1]), 4.5);
}

// Dropped on a floor. After contact nothing but gravity acts on the centre of mass: its velocity at a later frame, and
// its way between two of them, give the velocity of the rebound.
TEST_F(Runs, FindTheReboundOfAFreeBody) {
  make({.cells = {2, 1, 1}, .free = true}, true);
  SceneConfig config = scene();
  config.time_step = 0.001;
  config.gravity = {0, 0, -10};
  config.body.linear_velocity = Eigen::Vector3d(0.3, 0, -1);
  ObstacleConfig floor;
  floor.shape = PlaneConfig{.point = {0, 0, -0.05}, .normal = {0, 0, 1}};
  floor.stiffness = 1e6;
  config.obstacles = {floor};
  const std::vector<double> times{0.12, 0.14, 0.16, 0.3};
  errors(config, times);
  const SparseMatrix mass = scalar_mass(bar_.model.object->mesh, bar_.model.object->materials.density);
  const Eigen::VectorXd weights = mass * Eigen::VectorXd::Ones(mass.cols());
  for (const BodyFrames* frames : {&full_, &reduced_.frames}) {
    ASSERT_TRUE(frames->rebound);
    const Rebound& rebound = *frames->rebound;
    const auto centre = [&](const VertexArray& field) -> Eigen::Vector3d {
      return field.transpose() * weights / weights.sum();
    };
    ASSERT_LT(rebound.time, 0.14) << "frames after it";
    const Eigen::Vector3d way = centre(frames->positions[2]) - centre(frames->positions[1]);
    const Eigen::Vector3d expected = way / 0.02 - config.gravity * (0.15 - rebound.time);
    // The tolerance is one step of gravity, for the steps of backward Euler next to contact.
    EXPECT_LE((rebound.velocity - expected).norm(), 10 * config.time_step) << rebound.velocity.transpose();
    EXPECT_GT(rebound.velocity.z(), 0.1) << "it bounces";
  }
}

// Positions a little later and earlier give the velocities.
TEST_F(Runs, VelocitiesAreTheRatesOfPositions) {
  make({.cells = {2, 1, 1}, .free = true});
  const auto model = runtime::build_model(bar_.model, {}).model;
  runtime::State state = runtime::make_state(*model);
  state.q.setLinSpaced(state.q.size(), -0.02, 0.03);
  state.v.setLinSpaced(state.v.size(), 0.4, -0.3);
  runtime::FrameMotion motion;
  motion.position = {1, 2, 3};
  motion.orientation = Eigen::Quaterniond(0.5, 0.1, -0.7, 0.3).normalized();
  motion.linear_velocity = {1, -2, 0.5};
  motion.angular_velocity = {0.3, 2, -1};
  runtime::set_motion(*model, motion, state);
  const VertexArray velocities = world_frame(bar_.model, *model->frame, state).velocities;
  constexpr double kStep = 1e-5;
  const auto moved = [&](double time) {
    runtime::State later = state;
    later.q += time * state.v;
    free_state(later).position += time * motion.linear_velocity;
    const double angle = time * motion.angular_velocity.norm();
    free_state(later).orientation =
        Eigen::AngleAxisd(angle, motion.angular_velocity.normalized()) * free_state(state).orientation;
    return world_frame(bar_.model, *model->frame, later).positions;
  };
  const VertexArray rates = (moved(kStep) - moved(-kStep)) / (2 * kStep);
  EXPECT_LE((rates - velocities).lpNorm<Eigen::Infinity>(), 1e-8 * velocities.lpNorm<Eigen::Infinity>());
}

TEST_F(Runs, AreTimedInTurns) {
  make({.cells = {2, 1, 1}, .examples = 3});
  SceneConfig plain = scene(), with_examples = scene();
  plain.steps = with_examples.steps = 40;
  with_examples.examples.emplace();
  with_examples.examples->stiffness = 400;
  const std::vector<StepTimes> all = time_steps({plain, with_examples}, {.rounds = 3, .steps = 30});
  ASSERT_EQ(all.size(), 2U);
  for (const StepTimes& times : all) {
    EXPECT_EQ(times.steps, 90);
    EXPECT_GT(times.median, 0);
    EXPECT_GE(times.p95, times.median);
    EXPECT_GT(times.stages[2], 0) << "the internal force";
    EXPECT_LT(times.stages[2], times.p95);
  }
  EXPECT_EQ(all[0].interpolation, 0);
  EXPECT_GT(all[1].interpolation, 0);
}

TEST_F(Runs, StopAtNumbersThatAreNotFinite) {
  make({.cells = {2, 1, 1}});
  SceneConfig config = scene();
  config.gravity = {0, 1e300, 0};
  EXPECT_THROW(run_reduced(config, {0.1}), WorkError);
}

TEST_F(Runs, TakeNoKeysAndAWeightForEachExample) {
  make({.cells = {2, 1, 1}, .examples = 3});
  SceneConfig config = scene();
  config.gravity_keys = {{0}, {config.gravity}};
  EXPECT_THROW(run_reduced(config, {0.1}), InputError);
  EXPECT_THROW(run_full_space(config, bar_.model, {0.1}), InputError);
  config.gravity_keys = {};
  config.examples.emplace().weights = Eigen::Vector2d::UnitX();
  EXPECT_THROW(run_full_space(config, bar_.model, {0.1}), InputError);
}

}  // namespace
}  // namespace exmat::precompute
