#include "runtime/sim/lanes/lane_step.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>
#include <vector>

#include "tests/support/allocation_counter.h"
#include "tests/support/random.h"
#include "tests/support/scenes.h"

// Steps of bodies side by side against the steps of the same bodies one by one.

namespace exmat::runtime {
namespace {

using test::Bar;
using test::BarOptions;

/// Bodies of one model, each in its own pose, under loads and settings of its own.
struct Crowd {
  std::vector<StepScene> scenes;
  std::vector<State> states;

  std::vector<LaneBody> bodies() {
    std::vector<LaneBody> found;
    for (std::size_t i = 0; i < states.size(); ++i) found.push_back({&scenes[i], &states[i]});
    return found;
  }
};

struct Kind {
  BarOptions bar{};
  ModelOptions model{};
  Integrator integrator = Integrator::kBdf2;
  double tolerance = 1e-11;
};

Eigen::VectorXd pose(const Bar& bar, double amplitude, std::uint32_t seed) {
  Eigen::VectorXd q = test::random_vector(bar.modes(), seed);
  for (Eigen::Index i = 0; i < q.size(); ++i) q[i] /= static_cast<double>((i + 1) * (i + 1));
  return amplitude * bar.length / (bar.basis() * q).lpNorm<Eigen::Infinity>() * q;
}

Crowd make_crowd(const Bar& bar, const Model& model, const Kind& kind, std::size_t count) {
  Crowd crowd;
  for (std::size_t i = 0; i < count; ++i) {
    const double share = static_cast<double>(i + 1) / static_cast<double>(count);
    StepScene scene = free_scene(model, kind.integrator, 0.002);
    scene.newton.tolerance = kind.tolerance;
    scene.mass_damping = 0.3 * share;
    scene.stiffness_damping = i % 3 == 0 ? 0 : 0.002;
    scene.gravity = Eigen::Vector3d(0.5 - share, -2 * share, 1);
    scene.gravity_force = gravity_force(model, scene.gravity);
    if (!model.examples.empty()) {
      scene.examples = {ExampleSettings{300 * share, 2, 0.5 + 0.5 * share}};
      if (i % 4 == 3) scene.examples.front().given_weights = Eigen::Vector3d(0.2, 0.5, 0.3);
    }
    const auto seed = static_cast<std::uint32_t>(i);
    const Eigen::VectorXd q = pose(bar, 0.1 * share, seed);
    State state = make_state(model, q, 5 * pose(bar, 0.1, seed + 100));
    Workspace workspace(model, scene);
    state.elastic_energy = model.internal_force.energy(q, workspace.elasticity);
    FrameMotion motion;
    motion.position = Eigen::Vector3d(1, 2, 3);
    motion.linear_velocity = Eigen::Vector3d(1, -2, 0.5);
    motion.angular_velocity = 4 * share * Eigen::Vector3d(0.3, 0.9, 0.2);
    set_motion(model, motion, state);
    crowd.scenes.push_back(scene);
    crowd.states.push_back(state);
  }
  return crowd;
}

void step_each(const Model& model, Crowd& crowd, std::vector<StepReport>& reports) {
  Workspace workspace(model, crowd.scenes.front());
  for (std::size_t i = 0; i < crowd.states.size(); ++i)
    reports[i] = step(model, crowd.scenes[i], crowd.states[i], workspace);
}

double difference(const Model& model, const State& a, const State& b) {
  const auto of_frame = [&](const State& state) -> Eigen::VectorXd { return model.frame->coordinates(state.frame); };
  const Eigen::VectorXd own = of_frame(a), others = of_frame(b);
  double frame = own.size() == 0 ? 0 : (own - others).norm() / (1 + own.norm());
  return std::max({(a.q - b.q).norm() / a.q.norm(), (a.v - b.v).norm() / (a.v.norm() + a.q.norm()), frame});
}

std::vector<std::pair<std::string, Kind>> kinds() {
  std::vector<std::pair<std::string, Kind>> found;
  for (const bool free : {false, true}) {
    const std::string name = free ? "free" : "clamped";
    found.push_back({name, {.bar = {.free = free}}});
    found.push_back({name + "_newmark", {.bar = {.free = free}, .integrator = Integrator::kNewmark}});
    found.push_back({name + "_euler", {.bar = {.free = free}, .integrator = Integrator::kBackwardEuler}});
    found.push_back({name + "_examples", {.bar = {.free = free, .examples = 3}}});
    found.push_back({name + "_table", {.bar = {.free = free, .examples = 3}, .model = {.target_table = true}}});
    found.push_back({name + "_neo_hookean", {.bar = {.material = MaterialModel::kStableNeoHookean, .free = free}}});
    found.push_back({name + "_corotational", {.bar = {.material = MaterialModel::kCorotational, .free = free}}});
  }
  return found;
}

// 1,000 steps of 10 bodies: a full group, and two in one of their own. Newton's tolerance is near rounding; what
// remains is the order of sums.
TEST(LaneStep, MovesBodiesAsOneByOne) {
  for (const auto& [name, kind] : kinds()) {
    const Bar bar = full_bar(kind.bar);
    const auto model = prepared(bar, kind.model);
    Crowd lanes = make_crowd(bar, *model, kind, 10), each = lanes;
    ASSERT_TRUE(can_step_side_by_side(*model, lanes.scenes.front()));
    LaneWorkspace workspace(*model, lanes.scenes.front());
    std::vector<StepReport> reports(10), expected(10);
    int iterations = 0, factorisations = 0;
    for (int n = 0; n < 1000; ++n) {
      const auto bodies = lanes.bodies();
      step_in_lanes(*model, std::span(bodies).first(8), workspace, std::span(reports).first(8));
      step_in_lanes(*model, std::span(bodies).last(2), workspace, std::span(reports).last(2));
      step_each(*model, each, expected);
      for (std::size_t i = 0; i < 10; ++i) {
        ASSERT_EQ(reports[i].status & ~kStepStagnated, 0U) << name << ", body " << i << ", step " << n;
        iterations += reports[i].newton_iterations - expected[i].newton_iterations;
        factorisations += reports[i].factorisations - expected[i].factorisations;
      }
    }
    for (std::size_t i = 0; i < 10; ++i) {
      EXPECT_LE(difference(*model, each.states[i], lanes.states[i]), 1e-10) << name << ", body " << i;
      EXPECT_NEAR(lanes.states[i].elastic_energy, each.states[i].elastic_energy, 1e-9 * each.states[i].elastic_energy);
      EXPECT_GT(lanes.states[i].q.norm(), 1e-3 * bar.length) << name << ": it does not move";
    }
    // The same work, but for residuals that rounding lets pass or not.
    EXPECT_LE(std::abs(iterations), 200) << name;
    EXPECT_LE(std::abs(factorisations), 100) << name;
  }
}

// 1,000 steps with stiffness in single precision, which the residual is not: the same motion where no damping is made
// of that stiffness, and as many iterations.
TEST(LaneStep, MixedPrecisionMovesBodiesAsDouble) {
  for (const auto& [name, kind] : kinds()) {
    const Bar bar = full_bar(kind.bar);
    const auto model = prepared(bar, kind.model);
    Crowd mixed = make_crowd(bar, *model, kind, 8), exact = mixed;
    for (StepScene& scene : mixed.scenes) scene.precision = Precision::kMixed;
    LaneWorkspace workspace(*model, mixed.scenes.front());
    std::vector<StepReport> reports(8), expected(8);
    int more = 0, all = 0;
    for (int n = 0; n < 1000; ++n) {
      step_in_lanes(*model, mixed.bodies(), workspace, reports);
      step_in_lanes(*model, exact.bodies(), workspace, expected);
      for (std::size_t i = 0; i < 8; ++i) {
        ASSERT_EQ(reports[i].status & ~kStepStagnated, 0U) << name << ", body " << i << ", step " << n;
        more += reports[i].newton_iterations - expected[i].newton_iterations;
        all += expected[i].newton_iterations;
      }
    }
    for (std::size_t i = 0; i < 8; ++i) {
      const bool damped = mixed.scenes[i].stiffness_damping > 0;
      EXPECT_LE(difference(*model, exact.states[i], mixed.states[i]), damped ? 1e-6 : 1e-9) << name << ", body " << i;
    }
    EXPECT_GT(difference(*model, exact.states[1], mixed.states[1]), 0) << name << ": it is the same";
    EXPECT_LE(std::abs(more), all / 20) << name;
  }
}

TEST(LaneStep, NoBodyDependsOnTheOthers) {
  const Kind kind{.bar = {.free = true, .examples = 3}};
  const Bar bar = test::make_bar(kind.bar);
  const auto model = prepared(bar);
  const Crowd crowd = make_crowd(bar, *model, kind, 8);
  Crowd all = crowd;
  LaneWorkspace workspace(*model, crowd.scenes.front());
  std::vector<StepReport> reports(8);
  for (int n = 0; n < 50; ++n) step_in_lanes(*model, all.bodies(), workspace, reports);
  // Five of them, in another order.
  const std::array<std::size_t, 5> chosen{6, 0, 7, 3, 2};
  Crowd few;
  for (const std::size_t i : chosen) {
    few.scenes.push_back(crowd.scenes[i]);
    few.states.push_back(crowd.states[i]);
  }
  for (int n = 0; n < 50; ++n) step_in_lanes(*model, few.bodies(), workspace, std::span(reports).first(5));
  for (std::size_t k = 0; k < chosen.size(); ++k)
    EXPECT_EQ(difference(*model, all.states[chosen[k]], few.states[k]), 0) << k;
}

// The predictor or the pose before it is evaluated first by what the last step took; which bodies come next is known or
// not. A workspace that knows nothing takes the same steps to the bit.
TEST(LaneStep, NoResultDependsOnWhatAWorkspaceHasSeen) {
  const Bar bar = test::make_bar();
  const auto model = prepared(bar);
  Crowd known = make_crowd(bar, *model, Kind{.tolerance = 1e-9}, 8);
  for (StepScene& scene : known.scenes) scene.time_step = 0.05;
  Crowd unknown = known;
  LaneWorkspace workspace(*model, known.scenes.front());
  std::vector<StepReport> reports(8), expected(8);
  int left = 0, mixed = 0;
  for (int n = 0; n < 100; ++n) {
    step_in_lanes(*model, known.bodies(), workspace, reports, known.bodies());
    LaneWorkspace fresh(*model, known.scenes.front());
    step_in_lanes(*model, unknown.bodies(), fresh, expected);
    int now = 0;
    for (std::size_t i = 0; i < 8; ++i) {
      EXPECT_EQ(reports[i].line_search_evaluations, expected[i].line_search_evaluations);
      now += expected[i].line_search_evaluations > 0 ? 1 : 0;
    }
    left += now;
    mixed += now > 0 && now < 8 ? 1 : 0;
  }
  EXPECT_GT(left, 0) << "no predictor was left";
  EXPECT_GT(mixed, 0);
  for (std::size_t i = 0; i < 8; ++i) EXPECT_EQ(difference(*model, unknown.states[i], known.states[i]), 0) << i;
}

// Newton's method needs more for these: a body pushed flat so that Hessians are indefinite, and one without a number.
TEST(LaneStep, ABodyThatNeedsMoreStepsByItself) {
  const Kind kind{.tolerance = 1e-9};
  const Bar bar = test::make_bar();
  const auto model = prepared(bar);
  Crowd lanes = make_crowd(bar, *model, kind, 6);
  for (StepScene& scene : lanes.scenes) scene.time_step = 0.02;
  lanes.states[2].q = pose(bar, 3, 7);
  auto elasticity = model->internal_force.make_workspace();
  lanes.states[2].elastic_energy = model->internal_force.energy(lanes.states[2].q, elasticity);
  lanes.states[4].v.setConstant(std::numeric_limits<double>::infinity());
  Crowd each = lanes;
  LaneWorkspace workspace(*model, lanes.scenes.front());
  std::vector<StepReport> reports(6), expected(6);
  int harder = 0;
  for (int n = 0; n < 30; ++n) {
    step_in_lanes(*model, lanes.bodies(), workspace, reports);
    step_each(*model, each, expected);
    harder += expected[2].projections + expected[2].line_search_evaluations;
    EXPECT_EQ(reports[4].status, kStepNonFinite);
  }
  EXPECT_GT(harder, 0);
  for (const std::size_t i : {0U, 1U, 2U, 3U, 5U})
    EXPECT_LE(difference(*model, each.states[i], lanes.states[i]), 1e-7) << i;
}

Obstacle solid(const Shape& shape, double friction = 0) {
  Obstacle obstacle;
  obstacle.shape = shape;
  obstacle.stiffness = 2e6;
  obstacle.damping = 1e4;
  obstacle.friction = friction;
  return obstacle;
}

enum class Frame { kFree, kClamped, kCarried };

/// Obstacles that the bodies of a crowd meet, and how their frames move.
struct Ground {
  std::string name;
  Obstacles obstacles;
  Frame frame = Frame::kFree;
};

std::vector<Ground> grounds() {
  const Plane floor{Eigen::Vector3d::Zero(), Eigen::Vector3d::UnitZ()};
  const Plane below{Eigen::Vector3d(0, 0, -0.01), Eigen::Vector3d::UnitZ()};
  const Plane slope{Eigen::Vector3d::Zero(), Eigen::Vector3d(0.2, 0.1, 1).normalized()};
  const Box box{Eigen::Vector3d(0.1, 0, -1), Eigen::Vector3d(0.6, 0.5, 1)};
  const Sphere sphere{Eigen::Vector3d(0.05, 0, -2), 2};
  Obstacle lift = solid(floor, 0.5);
  lift.motion = RigidMotion::going_on(0, {.linear_velocity = Eigen::Vector3d(0.1, 0, 0.2)});
  return {{"floor", {solid(floor)}},
          {"clamped_floor", {solid(below, 0.3)}, Frame::kClamped},
          {"carried_floor", {solid(below, 0.3)}, Frame::kCarried},
          {"slope", {solid(slope, 0.6)}},
          {"slippery_slope", {solid(slope, 0.1)}},
          {"box", {solid(box, 0.4)}},
          {"sphere", {solid(sphere, 0.4)}},
          {"corner", {solid(floor, 0.4), solid(slope, 0.2), solid(sphere)}},
          {"lift", {lift}}};
}

/// Bodies above it, each at a height of its own: some touch in the first step, others fall for a while, the last never
/// come near.
Crowd crowd_above(const Ground& ground, const Bar& bar, const Model& model, std::size_t count) {
  Crowd crowd = make_crowd(bar, model, {.integrator = Integrator::kBdf2}, count);
  for (std::size_t i = 0; i < count; ++i) {
    StepScene& scene = crowd.scenes[i];
    scene.obstacles = ground.obstacles;
    scene.mass_damping = 2;
    scene.gravity = Eigen::Vector3d(0, 0, -9.81);
    scene.gravity_force = gravity_force(model, scene.gravity);
    State& state = crowd.states[i];
    const auto height = 0.02 * static_cast<double>(i) + (i % 4 == 3 ? 50 : 0);
    set_motion(model,
               {.position = -model.frame->centre_of_mass() + Eigen::Vector3d(0, 0, 0.18 + height),
                .linear_velocity = Eigen::Vector3d(0.1, 0, -0.5),
                .angular_velocity = Eigen::Vector3d(0.3, 1, 0.2)},
               state);
    prepare_contacts(model, ground.obstacles.size(), state);
    if (ground.frame != Frame::kCarried) continue;
    const Eigen::Quaterniond tilted(Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitY()));
    scene.carrier = RigidMotion(std::vector<Keyframe>{{}, {0.4, Eigen::Vector3d(0, 0, -0.05), tilted}});
    Workspace workspace(model, scene);
    follow_frame(model, scene, state, workspace);
  }
  return crowd;
}

Bar touching_bar(Frame frame) {
  Bar bar = test::make_bar({.free = frame == Frame::kFree, .carried = frame == Frame::kCarried});
  bar.model.contact = test::surface_contact(bar.model);
  return bar;
}

// Falls, impacts and the rest after them: 400 steps of bodies that are near obstacles and of others beside them.
TEST(LaneStep, MovesBodiesNearObstaclesAsOneByOne) {
  for (const Ground& ground : grounds()) {
    const Bar bar = touching_bar(ground.frame);
    const auto model = prepared(bar, {.carried = ground.frame == Frame::kCarried});
    Crowd lanes = crowd_above(ground, bar, *model, 8), each = lanes;
    LaneWorkspace workspace(*model, lanes.scenes.front());
    std::vector<StepReport> reports(8), expected(8);
    int contacts = 0, in_lanes = 0, iterations = 0, more = 0;
    for (int n = 0; n < 400; ++n) {
      step_in_lanes(*model, lanes.bodies(), workspace, reports);
      step_each(*model, each, expected);
      for (std::size_t i = 0; i < 8; ++i) {
        EXPECT_EQ(reports[i].contacts, expected[i].contacts) << ground.name << ", body " << i << ", step " << n;
        EXPECT_LE((reports[i].contact_force - expected[i].contact_force).norm(),
                  1e-5 * (1 + expected[i].contact_force.norm()));
        if (expected[i].contacts == 0) continue;
        ++contacts;
        in_lanes += difference(*model, each.states[i], lanes.states[i]) > 0 ? 1 : 0;
        iterations += expected[i].newton_iterations;
        more += reports[i].newton_iterations - expected[i].newton_iterations;
      }
      for (std::size_t i = 0; n == 40 && i < 8; ++i)
        EXPECT_LE(difference(*model, each.states[i], lanes.states[i]), 1e-9) << ground.name << ", body " << i;
    }
    for (std::size_t i = 0; i < 8; ++i)
      EXPECT_LE(difference(*model, each.states[i], lanes.states[i]), 1e-8) << ground.name << ", body " << i;
    EXPECT_GT(contacts, 200) << ground.name;
    EXPECT_GT(in_lanes, contacts / 2) << ground.name << ": they step by themselves";
    EXPECT_LE(std::abs(more), iterations / 50) << ground.name;
  }
}

// Stiffness in single precision, which the residual is not.
TEST(LaneStep, MixedPrecisionMovesBodiesNearObstaclesAsDouble) {
  const Bar bar = touching_bar(Frame::kFree);
  const auto model = prepared(bar);
  Crowd mixed = crowd_above(grounds().front(), bar, *model, 8);
  for (StepScene& scene : mixed.scenes) scene.stiffness_damping = 0;
  Crowd exact = mixed;
  for (StepScene& scene : mixed.scenes) scene.precision = Precision::kMixed;
  LaneWorkspace workspace(*model, mixed.scenes.front());
  std::vector<StepReport> reports(8), expected(8);
  int contacts = 0;
  for (int n = 0; n < 200; ++n) {
    step_in_lanes(*model, mixed.bodies(), workspace, reports);
    step_in_lanes(*model, exact.bodies(), workspace, expected);
    for (std::size_t i = 0; i < 8; ++i) {
      EXPECT_EQ(reports[i].contacts, expected[i].contacts) << "body " << i << ", step " << n;
      contacts += expected[i].contacts;
    }
  }
  EXPECT_GT(contacts, 0);
  for (std::size_t i = 0; i < 8; ++i)
    EXPECT_LE(difference(*model, exact.states[i], mixed.states[i]), 1e-8) << "body " << i;
  EXPECT_GT(difference(*model, exact.states[0], mixed.states[0]), 0) << "it is the same";
}

// Those near an obstacle and those that are not have each the same numbers beside any others.
TEST(LaneStep, NoBodyNearObstaclesDependsOnTheOthers) {
  const Ground ground = grounds()[2];
  const Bar bar = touching_bar(Frame::kFree);
  const auto model = prepared(bar);
  const Crowd crowd = crowd_above(ground, bar, *model, 8);
  Crowd all = crowd, few;
  const std::array<std::size_t, 4> chosen{6, 3, 0, 1};
  for (const std::size_t i : chosen) {
    few.scenes.push_back(crowd.scenes[i]);
    few.states.push_back(crowd.states[i]);
  }
  LaneWorkspace workspace(*model, crowd.scenes.front());
  std::vector<StepReport> reports(8);
  int contacts = 0;
  for (int n = 0; n < 200; ++n) {
    step_in_lanes(*model, all.bodies(), workspace, reports);
    for (const StepReport& report : reports) contacts += report.contacts;
    step_in_lanes(*model, few.bodies(), workspace, std::span(reports).first(4));
  }
  EXPECT_GT(contacts, 0);
  for (std::size_t k = 0; k < chosen.size(); ++k)
    EXPECT_EQ(difference(*model, all.states[chosen[k]], few.states[k]), 0) << k;
}

TEST(LaneStep, IsForWhatItKnows) {
  const Bar bar = full_bar({.density_gradient = 2, .examples = 3});
  const auto cubature = prepared(bar), polynomial = prepared(bar, {.polynomial = true});
  StepScene scene = free_scene(*cubature, Integrator::kBdf2, 0.01);
  EXPECT_TRUE(can_step_side_by_side(*cubature, scene));
  EXPECT_FALSE(can_step_side_by_side(*polynomial, scene));
  scene.examples = {ExampleSettings{100, 0, 1}};
  EXPECT_TRUE(can_step_side_by_side(*cubature, scene));
  scene.examples = {{.stiffness = 2, .elastic = true}};
  EXPECT_FALSE(can_step_side_by_side(*cubature, scene));
}

TEST(LaneStep, AllocatesNothingNearObstacles) {
  const Bar bar = touching_bar(Frame::kFree);
  const auto model = prepared(bar);
  Crowd crowd = crowd_above(grounds()[2], bar, *model, 8);
  const auto bodies = crowd.bodies();
  LaneWorkspace workspace(*model, crowd.scenes.front());
  std::vector<StepReport> reports(8);
  const test::AllocationCounter allocations;
  for (int n = 0; n < 100; ++n) step_in_lanes(*model, bodies, workspace, reports);
  EXPECT_EQ(allocations.count(), 0);
  EXPECT_GT(reports.front().contacts, 0);
}

TEST(LaneStep, AllocatesNothing) {
  const Kind kind{.bar = {.free = true, .examples = 3}};
  const Bar bar = test::make_bar(kind.bar);
  const auto model = prepared(bar);
  Crowd crowd = make_crowd(bar, *model, kind, 8);
  const auto bodies = crowd.bodies();
  LaneWorkspace workspace(*model, crowd.scenes.front());
  std::vector<StepReport> reports(8);
  step_in_lanes(*model, bodies, workspace, reports);
  const test::AllocationCounter allocations;
  for (int n = 0; n < 20; ++n) step_in_lanes(*model, bodies, workspace, reports);
  EXPECT_EQ(allocations.count(), 0);
}

}  // namespace
}  // namespace exmat::runtime
