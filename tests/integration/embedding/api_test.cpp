#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <exmat/exmat.hpp>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <span>
#include <thread>

#include "common/config/config.h"
#include "common/core/thread_team.h"
#include "common/mesh/geometry.h"
#include "runtime/scene/scene_loader.h"
#include "runtime/sim/step/stepper.h"
#include "tests/integration/embedding/api_fixture.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/random.h"

namespace exmat {
namespace {

using test::AllocationCounter;
using test::ApiTest;
using test::displacement;
using test::span_of;
using test::velocity;
using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr std::array kIntegratorNames{"bdf2", "backward_euler", "newmark"};

/// A world whose bodies do not touch each other.
World apart() {
  exmat_contact_law law = default_contact_law();
  law.apart = 1;
  return World(law);
}

/// The library's own stepping of a scene.
struct Reference {
  explicit Reference(const std::string& scene) : loaded(runtime::load_run(load_scene(scene))) {
    refresh_weights(*loaded.model, loaded.scene, state, workspace);
  }
  /// Status bits of all steps.
  std::uint32_t step(int steps) {
    std::uint32_t status = 0;
    for (int i = 0; i < steps; ++i) status |= runtime::step(*loaded.model, loaded.scene, state, workspace).status;
    return status;
  }

  runtime::LoadedScene loaded;
  runtime::State state = runtime::make_state(*loaded.model);
  runtime::Workspace workspace{*loaded.model, loaded.scene};
};

TEST_F(ApiTest, StepsAreThoseOfTheLibraryBitForBit) {
  const std::string scene = files_.scene(
      test::kDampedExamples + fmt::format(", \"forces\": [{{\"vertices\": {{\"ids\": [{}]}}, \"force\": [0, 0, 5], "
                                          "\"start\": 0.02, \"end\": 0.1}}]",
                                          files_.tip()));
  Reference reference(scene);
  const Model scripted = Model::from_scene(scene);
  EXPECT_EQ(scripted.modes(), static_cast<std::size_t>(files_.bar().modes()));
  EXPECT_EQ(scripted.vertices(), static_cast<std::size_t>(files_.vertices()));
  EXPECT_EQ(scripted.examples(), 3u);
  EXPECT_EQ(scripted.time_step(), 0.005);
  Body body(scripted);
  for (const int steps : {0, 1, 30}) {
    reference.step(steps);
    EXPECT_EQ(body.step(steps).steps, steps);
    EXPECT_EQ(displacement(body, scripted.modes()), reference.state.q);
    EXPECT_EQ(velocity(body, scripted.modes()), reference.state.v);
    Eigen::VectorXd weights(3);
    body.read_weights(span_of(weights));
    EXPECT_EQ(weights, reference.state.examples.front().weights);
    const runtime::Energies expected = energies(*reference.loaded.model, reference.loaded.scene, reference.state);
    EXPECT_EQ(body.energies().kinetic, expected.kinetic);
    EXPECT_EQ(body.energies().elastic, expected.elastic);
    EXPECT_EQ(body.energies().potential, expected.potential);
    EXPECT_EQ(body.time(), reference.state.time);
  }
}

TEST_F(ApiTest, RegionsHaveWeightsOfTheirOwn) {
  test::Bar bar = test::make_bar({.examples = 3});
  RegionData& region = bar.model.regions.emplace_back();
  region.name = "outer";
  region.vertices = IndexVector::Constant(1, 5);
  region.window = Eigen::VectorXd::Ones(1);
  region.band = Eigen::VectorXd::Zero(1);
  region.examples = *bar.model.examples;
  region.projection = *bar.model.projection;
  write_bundle(bar.model, files_.bundle());
  const std::string scene = files_.scene(R"("regions": [{"name": "outer", "stiffness": 100, "bias": 0.5}])");
  Reference reference(scene);
  const Model model = Model::from_scene(scene);
  EXPECT_EQ(model.examples(), 0u);
  ASSERT_EQ(model.regions(), 1u);
  EXPECT_EQ(model.region_examples(0), 3u);
  EXPECT_EQ(model.region_name(0), "outer");
  EXPECT_EQ(exmat_model_region_examples(model.get(), 1), -1);
  EXPECT_EQ(exmat_model_region_name(model.get(), -1), nullptr);
  Body body(model);
  body.step(5);
  reference.step(5);
  Eigen::VectorXd weights(3);
  body.read_region_weights(0, span_of(weights));
  EXPECT_EQ(weights, reference.state.examples.front().weights);
  EXPECT_LE(weights[0], 0.5);
  EXPECT_EQ(exmat_body_read_region_weights(body.get(), 1, weights.data(), 3), EXMAT_INVALID_ARGUMENT);
  EXPECT_NE(std::string(exmat_last_error()).find("region = 1: expected one of the model's 1"), std::string::npos);
  EXPECT_EQ(exmat_body_read_region_weights(body.get(), 0, weights.data(), 2), EXMAT_INVALID_ARGUMENT);
}

TEST_F(ApiTest, FreeBodiesArePlacedPushedAndRead) {
  const test::Bar bar = test::make_bar({.free = true, .examples = 3});
  write_bundle(bar.model, files_.bundle());
  const Model free = model();
  Body body(free);
  exmat_motion motion{0, {1, 2, 3}, {0.8, 0, 0.6, 0}, {0.5, 0, 0}, {0, 0, 2}};
  body.set_motion(motion);
  const std::vector<std::int64_t> ids{0, 7};
  const Points points = Points::vertices(free, ids);
  std::vector<float> xyz(6);
  body.read_positions(points, xyz);
  const Eigen::Quaterniond turn(0.8, 0, 0.6, 0);
  const Eigen::Vector3d centre = bar.model.rigid->centre_of_mass;
  for (std::size_t i = 0; i < ids.size(); ++i) {
    const Eigen::Vector3d rest = bar.model.object->mesh.vertices.row(ids[i]);
    const Eigen::Vector3d expected = centre + Eigen::Vector3d(1, 2, 3) + turn * (rest - centre);
    for (int axis = 0; axis < 3; ++axis) EXPECT_NEAR(xyz[3 * i + static_cast<std::size_t>(axis)], expected[axis], 1e-6);
  }
  // Two opposite forces: a couple, which changes the angular momentum alone.
  const std::vector<double> couple{0, 0, 4, 0, 0, -4};
  body.apply_forces(points, couple);
  body.step(1);
  const exmat_motion turned = body.motion();
  EXPECT_EQ(turned.linear_velocity[0], 0.5);
  EXPECT_NE(turned.angular_velocity[0], motion.angular_velocity[0]);
  body.clear_forces();
  const std::vector<double> push{0, 8, 0, 0, 8, 0};
  body.apply_forces(points, push);
  body.step(10);
  const double gained = body.motion().linear_velocity[1] - turned.linear_velocity[1];
  EXPECT_NEAR(gained, 10 * free.time_step() * (16 / bar.model.rigid->mass - 9.81), 1e-12);
  motion.orientation[0] = motion.orientation[2] = 0;
  EXPECT_THROW(body.set_motion(motion), Error);
}

TEST_F(ApiTest, SettingsGiveTheScene) {
  Reference reference(files_.scene(test::kDampedExamples));
  const std::uint32_t status = reference.step(25);
  const Model same = model();
  Body body(same);
  const exmat_report report = body.step(25);
  EXPECT_EQ(displacement(body, same.modes()), reference.state.q);
  EXPECT_EQ(report.status, status);
  EXPECT_GE(report.newton_iterations, 25);
  EXPECT_GE(report.factorisations, 1);
  EXPECT_GT(report.seconds, 0);
  EXPECT_EQ(body.report().newton_iterations, report.newton_iterations);
}

TEST_F(ApiTest, AppliedForcesAreThoseOfAScript) {
  for (std::size_t integrator = 0; integrator < kIntegratorNames.size(); ++integrator) {
    const std::string members = fmt::format("\"integrator\": \"{}\"", kIntegratorNames[integrator]);
    Reference scripted(files_.scene(
        members + fmt::format(", \"forces\": [{{\"vertices\": {{\"ids\": [{}, 30]}}, \"force\": [1, 2, -3], "
                              "\"start\": 0.05, \"end\": 0.1}}]",
                              files_.tip())));
    const Model model = Model::from_scene(files_.scene(members));
    const std::array<std::int64_t, 2> ids{files_.tip(), 30};
    const Points points = Points::vertices(model, ids);
    const std::array<double, 6> forces{1, 2, -3, 1, 2, -3};
    Body body(model);
    body.step(10);
    body.apply_forces(points, forces);
    body.restart_integrator();
    body.step(10);
    body.clear_forces();
    body.restart_integrator();
    body.step(10);
    scripted.step(30);
    const Eigen::VectorXd q = displacement(body, model.modes());
    EXPECT_GT(q.norm(), 0);
    EXPECT_LE((q - scripted.state.q).norm(), 1e-9 * q.norm()) << kIntegratorNames[integrator];
  }
}

TEST_F(ApiTest, ForcesAddUpUntilTheyAreCleared) {
  const Model model = this->model();
  const std::array<std::int64_t, 1> ids{files_.tip()};
  const Points points = Points::vertices(model, ids);
  Body once(model), twice(model), never(model), cleared(model);
  once.apply_forces(points, std::array{2.0, 0.0, 4.0});
  for (int i = 0; i < 2; ++i) twice.apply_forces(points, std::array{1.0, 0.0, 2.0});
  cleared.apply_forces(points, std::array{1.0, 0.0, 2.0});
  cleared.clear_forces();
  for (Body* body : {&once, &twice, &never, &cleared}) body->step(10);
  EXPECT_EQ(displacement(once, model.modes()), displacement(twice, model.modes()));
  EXPECT_EQ(displacement(never, model.modes()), displacement(cleared, model.modes()));
  EXPECT_NE(displacement(once, model.modes()), displacement(never, model.modes()));
}

TEST_F(ApiTest, PointsInATetMoveAsItDoes) {
  const Model model = this->model();
  const TetMesh& mesh = files_.bar().model.object->mesh;
  const Eigen::Vector4d shares(0.4, 0.3, 0.2, 0.1);
  const VertexArray corners = tet_positions(mesh, 57);
  const Eigen::Vector3d inside = corners.transpose() * shares;
  const Points point = Points::at(model, span_of(inside));
  EXPECT_EQ(point.distances(), std::vector<double>{0});
  std::array<std::int64_t, 4> ids{};
  for (int c = 0; c < 4; ++c) ids[static_cast<std::size_t>(c)] = mesh.tets(57, c);
  const Points vertices = Points::vertices(model, ids);
  ASSERT_EQ(vertices.size(), 4u);

  // A force on the point is its share of that force on each corner: the same virtual work.
  const Eigen::Vector3d force(3, -2, 1);
  const VertexArray on_corners = shares * force.transpose();
  Body a(model), b(model);
  a.apply_forces(point, span_of(force));
  b.apply_forces(vertices, span_of(on_corners));
  a.step(20);
  b.step(20);
  const Eigen::VectorXd q = displacement(a, model.modes());
  EXPECT_LE((q - displacement(b, model.modes())).norm(), 1e-9 * q.norm());

  Eigen::Vector3f found;
  Eigen::Matrix<float, 4, 3, Eigen::RowMajor> moved;
  a.read_positions(point, span_of(found));
  a.read_positions(vertices, span_of(moved));
  EXPECT_LE((found - moved.transpose() * shares.cast<float>()).norm(), 1e-6f);
  EXPECT_GT((found.cast<double>() - inside).norm(), 1e-4);
}

/// Distance of a point to a box with a corner at the origin.
double distance_to_bar(const Eigen::Vector3d& point, const std::array<double, 3>& lengths) {
  const Eigen::Vector3d upper(lengths.data());
  return (point - point.cwiseMax(Eigen::Vector3d::Zero()).cwiseMin(upper)).norm();
}

TEST_F(ApiTest, PointsAreInTheNearestTet) {
  const Model model = this->model();
  constexpr Eigen::Index kPoints = 400;
  VertexArray xyz = 0.4 * test::random_matrix(kPoints, 3, 5);
  xyz.col(0).array() += 0.5;
  const TetMesh& mesh = files_.bar().model.object->mesh;
  xyz.topRows<63>() = mesh.vertices.topRows<63>();
  const Points points = Points::at(model, span_of(xyz));
  const std::vector<double> distances = points.distances();
  Body body(model);
  Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor> read(kPoints, 3);
  body.read_positions(points, span_of(read));
  Eigen::Index inside = 0;
  for (Eigen::Index i = 0; i < kPoints; ++i) {
    EXPECT_NEAR(distances[static_cast<std::size_t>(i)], distance_to_bar(xyz.row(i), {1.0, 0.25, 0.25}), 1e-12);
    inside += distances[static_cast<std::size_t>(i)] == 0;
  }
  EXPECT_GT(inside, 63);
  EXPECT_LT(inside, kPoints);
  // At rest each is where it was given.
  EXPECT_EQ(read, xyz.cast<float>());

  // Points given as the places of vertices move as those vertices.
  std::vector<float> all(3 * model.vertices());
  const Points vertices = Points::all_vertices(model);
  body.step(20);
  body.read_positions(vertices, all);
  body.read_positions(points, span_of(read));
  for (std::size_t i = 0; i < 3 * 63; ++i) EXPECT_NEAR(read.data()[i], all[i], 1e-6f);
}

TEST_F(ApiTest, PositionsAreThoseOfTheReducedState) {
  const Model model = this->model();
  Body body(model);
  body.step(30);
  const Eigen::VectorXd q = displacement(body, model.modes());
  const VertexArray& rest = files_.bar().model.object->mesh.vertices;
  const Eigen::VectorXd exact = rest.reshaped<Eigen::RowMajor>() + files_.bar().basis() * q;
  Eigen::VectorXf xyz(exact.size());
  body.read_positions(Points::all_vertices(model), span_of(xyz));
  EXPECT_LE((xyz.cast<double>() - exact).cwiseAbs().maxCoeff(), 3e-7);

  // Repeated and in any order.
  const std::array<std::int64_t, 3> ids{40, 7, 40};
  Eigen::Matrix<float, 9, 1> some;
  body.read_positions(Points::vertices(model, ids), span_of(some));
  for (int i = 0; i < 3; ++i) EXPECT_EQ(some.segment<3>(3 * i), xyz.segment<3>(3 * ids[static_cast<std::size_t>(i)]));
}

TEST_F(ApiTest, ResetAndSetReducedBeginAnew) {
  const Model model = this->model();
  const std::array<std::int64_t, 1> ids{files_.tip()};
  const Points points = Points::vertices(model, ids);
  Body fresh(model), body(model);
  body.apply_forces(points, std::array{1.0, 2.0, 3.0});
  body.step(7);
  body.restart_integrator();
  body.reset();
  EXPECT_EQ(body.time(), 0);
  fresh.step(20);
  body.step(20);
  EXPECT_EQ(displacement(fresh, model.modes()), displacement(body, model.modes()));

  const Eigen::VectorXd q = 0.02 * test::random_vector(static_cast<Eigen::Index>(model.modes()), 1);
  const Eigen::VectorXd v = test::random_vector(q.size(), 2);
  Reference reference(files_.scene(test::kDampedExamples));
  reference.state = runtime::make_state(*reference.loaded.model, q, v);
  body.set_reduced(span_of(q), span_of(v));
  EXPECT_EQ(body.energies().elastic, reference.state.elastic_energy);
  EXPECT_EQ(body.energies().kinetic, 0.5 * v.squaredNorm());
  reference.step(10);
  body.step(10);
  EXPECT_EQ(displacement(body, model.modes()), reference.state.q);
}

TEST_F(ApiTest, AnyNumberOfThreadsGivesTheSameBits) {
  const Model damped = model(), plain = plain_model();
  const auto hash = [&](int threads) {
    World bodies = apart();
    const std::array<std::int64_t, 1> ids{files_.tip()};
    for (int i = 0; i < 9; ++i) {
      const Model& its = i % 2 == 0 ? damped : plain;
      bodies.add(Body(its));
      bodies.body(static_cast<std::int64_t>(bodies.size()) - 1)
          .apply_forces(Points::vertices(its, ids), std::array{0.1 * i, 1.0, 0.0});
    }
    bodies.step(15, threads);
    std::vector<double> all;
    for (std::size_t i = 0; i < bodies.size(); ++i) {
      const Eigen::VectorXd q = displacement(bodies.body(static_cast<std::int64_t>(i)), damped.modes());
      all.insert(all.end(), q.begin(), q.end());
      EXPECT_EQ(bodies.body(static_cast<std::int64_t>(i)).report().steps, 15);
    }
    return all;
  };
  const std::vector<double> alone = hash(1);
  for (const int threads : {0, 2, 3, 20}) EXPECT_EQ(hash(threads), alone) << threads << " threads";
}

// Nine of one model, eight of them in lanes; then two of another, too few; and five in lanes again.
TEST_F(ApiTest, BodiesSideBySideMoveAsEachByItself) {
  const Model damped = model(), plain = plain_model();
  const std::array<std::int64_t, 1> ids{files_.tip()};
  constexpr int kCount = 16;
  const auto push = [&](BodyRef body, int i, const Model& its) {
    body.apply_forces(Points::vertices(its, ids), std::array{0.05 * i, 1.0, 0.0});
  };
  const auto model_of = [&](int i) -> const Model& { return i == 9 || i == 10 ? plain : damped; };
  for (const int threads : {1, 2}) {
    World bodies = apart();
    for (int i = 0; i < kCount; ++i) {
      bodies.add(Body(model_of(i)));
      push(bodies.body(i), i, model_of(i));
    }
    bodies.step(40, threads);
    for (int i = 0; i < kCount; ++i) {
      const BodyRef together = bodies.body(i);
      Body alone(model_of(i));
      push(alone, i, model_of(i));
      alone.step(40);
      EXPECT_EQ(together.report().steps, 40);
      EXPECT_EQ(together.report().newton_iterations, alone.report().newton_iterations) << i;
      const Eigen::VectorXd q = displacement(alone, damped.modes());
      // 1e-13 of each step in lanes.
      EXPECT_LE((displacement(together, damped.modes()) - q).norm(), 40 * 1e-13 * q.norm()) << i;
    }
  }
}

TEST_F(ApiTest, ANonFiniteStepLeavesItsBodyAndEndsTheCall) {
  const Model model = this->model();
  exmat_settings damped = default_settings();
  damped.time_step = damped_examples().time_step;
  damped.stiffness_damping = 1e290;
  const Model stiff(files_.bundle(), damped);
  World bodies = apart();
  for (int i = 0; i < 3; ++i) bodies.add(Body(i == 1 ? stiff : model));
  bodies.step(3);
  const std::vector<double> far(static_cast<std::size_t>(model.modes()), 1e30), rest(far.size(), 0);
  bodies.body(1).set_reduced(far, far);
  const Eigen::VectorXd before = displacement(bodies.body(1), model.modes());
  try {
    bodies.step(5);
    FAIL() << "stepped";
  } catch (const Error& error) {
    EXPECT_EQ(error.status(), EXMAT_NON_FINITE);
    EXPECT_THAT(error.what(), AllOf(HasSubstr("body 1, step 4 (t = 0.02 s)"), HasSubstr("smaller time_step")));
  }
  EXPECT_EQ(displacement(bodies.body(1), model.modes()), before);
  EXPECT_EQ(bodies.body(1).report().status, EXMAT_STEP_NON_FINITE);
  EXPECT_EQ(bodies.body(1).report().steps, 0);
  EXPECT_EQ(bodies.body(0).report().steps, 1);
  EXPECT_EQ(bodies.body(2).report().steps, 1);
  bodies.body(1).set_reduced(rest, rest);
  bodies.step(5);
  EXPECT_EQ(bodies.body(1).report().steps, 5);
  EXPECT_EQ(bodies.body(0).report().steps, 5);
}

TEST_F(ApiTest, WorldsStepOnThreadsOfTheHost) {
  const Model model = this->model();
  std::array<World, 2> worlds{apart(), apart()};
  for (World& world : worlds)
    for (int i = 0; i < 5; ++i) world.add(Body(model));
  int runs = 0;
  const auto on_the_host = [](void* user, void (*task)(void*, std::int32_t), void* data, std::int32_t count) {
    ++*static_cast<int*>(user);
    std::vector<std::thread> threads;
    for (std::int32_t i = 0; i < count; ++i) threads.emplace_back(task, data, i);
    for (std::thread& thread : threads) thread.join();
  };
  exmat_set_scheduler(on_the_host, &runs);
  const exmat_status status = exmat_world_step(worlds[0].get(), 5, 2, nullptr);
  exmat_set_scheduler(nullptr, nullptr);
  ASSERT_EQ(status, EXMAT_OK);
  if (processor_count() > 1) EXPECT_GE(runs, 5);
  ASSERT_EQ(exmat_world_step(worlds[1].get(), 5, 1, nullptr), EXMAT_OK);
  for (int i = 0; i < 5; ++i)
    EXPECT_EQ(displacement(worlds[0].body(i), model.modes()), displacement(worlds[1].body(i), model.modes())) << i;
}

TEST_F(ApiTest, StepsForcesAndReadsDoNotAllocate) {
  if (!AllocationCounter::works()) GTEST_SKIP() << "a sanitizer owns malloc";
  const Model model = this->model();
  const std::array<std::int64_t, 3> ids{1, 2, files_.tip()};
  const Points points = Points::vertices(model, ids), all = Points::all_vertices(model);
  Body first(model);
  World world = apart();
  for (int i = 0; i < 5; ++i) world.add(Body(model));
  std::array<double, 9> forces{};
  forces[8] = 5;
  std::vector<float> xyz(9), every(3 * model.vertices());
  std::vector<double> q(model.modes()), v(model.modes()), weights(3);
  exmat_energies energies{};
  energies.size = sizeof energies;
  exmat_report report{};
  report.size = sizeof report;
  exmat_world_step(world.get(), 1, 2, nullptr);  // starts the threads
  const AllocationCounter counter;
  exmat_body* const body = first.get();
  int status = exmat_body_apply_forces(body, points.get(), forces.data(), 9);
  status |= exmat_body_step(body, 10, &report);
  status |= exmat_body_restart_integrator(body);
  status |= exmat_world_step(world.get(), 5, 1, nullptr);
  status |= exmat_world_step(world.get(), 5, 2, nullptr);
  status |= exmat_body_read_positions(body, points.get(), xyz.data(), 9);
  status |= exmat_body_read_positions(body, all.get(), every.data(), static_cast<std::int64_t>(every.size()));
  status |= exmat_body_read_reduced(body, q.data(), v.data(), static_cast<std::int64_t>(q.size()));
  status |= exmat_body_read_weights(body, weights.data(), 3);
  status |= exmat_body_read_energies(body, &energies);
  status |= exmat_body_read_report(body, &report);
  status |= exmat_body_clear_forces(body);
  status |= exmat_body_set_reduced(body, q.data(), v.data(), static_cast<std::int64_t>(q.size()));
  status |= exmat_body_step(body, 5, nullptr);
  status |= exmat_body_reset(body);
  const bool refused = exmat_body_step(nullptr, 1, nullptr) == EXMAT_INVALID_ARGUMENT;
  EXPECT_EQ(counter.count(), 0u);
  EXPECT_EQ(status, EXMAT_OK);
  EXPECT_TRUE(refused);
}

}  // namespace
}  // namespace exmat
