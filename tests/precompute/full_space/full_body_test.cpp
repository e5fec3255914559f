#include "runtime/sim/space/full/full_body.h"

#include <Eigen/Geometry>
#include <cmath>
#include <gtest/gtest.h>
#include <optional>
#include <utility>

#include "runtime/sim/world/world.h"
#include "tests/precompute/full_space/full_space_bar.h"
#include "tests/support/random.h"

// Bodies that step in full space at run time, beside the full space of this stage, which shares no step with them:
// sparse Cholesky factors, all in double precision, another Newton's method.
namespace exmat::precompute {
namespace full_body_test {

constexpr double kTight = 1e-9;  // of Newton's methods

/// Regions of the parts, with their /full_space.
void add_regions(ReducedModel& model) {
  for (const bool outer : {true, false}) {
    add_region(model, outer ? "outer" : "inner", part_of_bar(model, outer));
    model.regions.back().full_space = full_space_data_of(model, &model.regions.back());
  }
}

struct TwinOptions {
  test::BarOptions bar{.cells = {4, 1, 1}};
  Integrator integrator = Integrator::kBdf2;
  int examples = 0;
  bool elastic = false;  ///< their force
  bool regions = false;  ///< and those of two regions
  double damping = 0;
  bool floor = false;
  double friction = 0.4;
  runtime::FrameMotion motion{};
  double time_step = 0.005;
};

/// A bar, a floor below it and a push, in both.
class Twin {
 public:
  explicit Twin(const TwinOptions& options) : options_(options), bar_(make(options)) {
    const ReducedModel& data = bar_.model;
    FullSpaceOptions reference;
    reference.whole_body = options.examples > 0;
    runtime::ModelOptions reduced{.examples = options.examples > 0, .elastic = options.elastic};
    if (options.regions) {
      reference.regions = {{"outer"}, {"inner"}};
      reduced.regions = {{"outer"}, {"inner"}};
    }
    reference_ = build_sparse_model(data, reference);
    model_ = std::move(runtime::build_model(data, reduced).model);
    full_ = std::move(runtime::build_full_model(data, *model_).model);
    set_scene();
    state_ = runtime::make_state(*model_);
    runtime::prepare_contacts(*model_, scene_.obstacles.size(), state_);
    runtime::set_motion(*model_, options.motion, state_);
    runtime::enter_full_space(*full_, *model_, state_);
    if (options.bar.free)
      expected_ = make_full_space_state(reference_, Eigen::VectorXd::Zero(reference_.rest.size()), options.motion);
    else
      expected_ = at_rest(reference_);
  }

  /// Largest distance of the two over the largest displacement, a free body's from free fall.
  double difference(int steps, const runtime::FullAccuracy& accuracy = {}) {
    runtime::Workspace workspace(*model_, scene_);
    runtime::FullWorkspace own(*full_, scene_, accuracy);
    SparseWorkspace reference_workspace(reference_);
    double off = 0, size = 0;
    for (int i = 0; i < steps; ++i) {
      const runtime::StepReport report = runtime::step_in_full_space(*full_, *model_, scene_, state_, workspace, own);
      EXPECT_EQ(report.status, 0U) << i;
      const SparseReport expected = step(reference_, reference_scene_, expected_, reference_workspace);
      EXPECT_EQ(expected.status, 0U) << i;
      contacts_ += report.contacts;
      EXPECT_NEAR(report.contacts, expected.contacts, options_.bar.free ? 2 : 0) << i;
      off = std::max(off, (state_.full->q - expected_.q).lpNorm<Eigen::Infinity>());
      size = std::max(size, expected_.q.lpNorm<Eigen::Infinity>());
      for (std::size_t k = 0; k < expected_.examples.size(); ++k)
        weights_off_ = std::max(weights_off_, (state_.examples[k].weights - expected_.examples[k].weights).norm());
    }
    size_ = size;
    return off / size;
  }

  double size() const { return size_; }
  int contacts() const { return contacts_; }
  double weights_off() const { return weights_off_; }
  runtime::State& state() { return state_; }
  const runtime::Model& model() const { return *model_; }
  const runtime::FullModel& full() const { return *full_; }
  const runtime::StepScene& scene() const { return scene_; }

 private:
  static test::Bar make(const TwinOptions& options) {
    test::BarOptions of = options.bar;
    of.examples = options.examples;
    test::Bar bar = complete_bar(of);
    if (options.examples > 0) bar.model.full_space = full_space_data_of(bar.model);
    if (options.elastic) make_elastic(bar.model);
    if (options.regions) add_regions(bar.model);
    if (options.floor) bar.model.contact = movable(bar.model);
    return bar;
  }
  static ContactData movable(const ReducedModel& model) {
    const ContactData all = test::surface_contact(model);
    std::vector<Eigen::Index> ids;
    for (Eigen::Index i = 0; i < all.vertices.size(); ++i)
      if (model.object->fixed[all.vertices[i]] == 0) ids.push_back(i);
    ContactData data{all.vertices(ids), all.positions(ids, Eigen::all), all.areas(ids), {}};
    data.basis.resize(3 * std::ssize(ids), all.basis.cols());
    for (std::size_t i = 0; i < ids.size(); ++i)
      data.basis.middleRows<3>(3 * static_cast<Eigen::Index>(i)) = all.basis.middleRows<3>(3 * ids[i]);
    return data;
  }

  void set_scene() {
    reference_scene_.time_step = scene_.time_step = options_.time_step;
    reference_scene_.integrator = scene_.integrator = options_.integrator;
    reference_scene_.mass_damping = scene_.mass_damping = options_.damping;
    reference_scene_.stiffness_damping = scene_.stiffness_damping = 0.01 * options_.damping;
    reference_scene_.newton = scene_.space.newton = {100, kTight};
    if (options_.examples > 0)
      reference_scene_.examples = scene_.examples = {{.stiffness = options_.elastic ? 2.0 : 300.0,
                                                      .damping = 2,
                                                      .bias = 0.4,
                                                      .target_iterations = 50,
                                                      .elastic = options_.elastic}};
    if (options_.regions) {
      for (const double bias : {0.2, 0.7})
        scene_.examples.push_back({.stiffness = 2000, .damping = 1, .bias = bias, .target_iterations = 50});
      reference_scene_.examples = scene_.examples;
    }
    if (options_.floor)
      reference_scene_.obstacles = scene_.obstacles = {
          runtime::Obstacle{runtime::Plane{{0, -0.05, 0}, {0, 1, 0}}, {}, 1e6, 1e3, options_.friction}};
    reference_scene_.gravity = scene_.gravity = Eigen::Vector3d(0, -12, 4);
    scene_.gravity_force = runtime::gravity_force(*model_, scene_.gravity);
    const std::int64_t last = reference_.rest.rows() - 1;
    const Eigen::Vector3d force(0, 30, 90);
    reference_scene_.forces = {{{last}, force, 0.05, 0.15}};
    runtime::ScriptedForce& scripted = scene_.forces.emplace_back();
    scripted.start = 0.05;
    scripted.end = 0.15;
    scripted.on_vertices = Eigen::VectorXd::Zero(full_->space.size());
    scripted.on_vertices.segment<3>(3 * full_->space.number(last)) = force;
  }

  TwinOptions options_;
  test::Bar bar_;
  SparseModel reference_;
  std::unique_ptr<const runtime::Model> model_;
  std::unique_ptr<const runtime::FullModel> full_;
  FullSpaceScene reference_scene_;
  runtime::StepScene scene_;
  runtime::State state_;
  FullSpaceState expected_;
  double size_ = 0, weights_off_ = 0;
  int contacts_ = 0;
};

// Residuals of 1e-9 of the forces, times how much softer the body is than its stiffest part.
constexpr double kSame = 1e-6;

TEST(FullBody, IsTheReferenceWhereItIsClamped) {
  for (const MaterialModel material :
       {MaterialModel::kStVenantKirchhoff, MaterialModel::kStableNeoHookean, MaterialModel::kCorotational}) {
    Twin twin({.bar = {.cells = {4, 1, 1}, .material = material}, .damping = 0.5});
    EXPECT_LE(twin.difference(60), kSame);
    EXPECT_GE(twin.size(), 0.1);
  }
}

TEST(FullBody, IsTheReferenceWithExamples) {
  Twin twin({.examples = 3, .damping = 0.5});
  EXPECT_LE(twin.difference(60), kSame);
  EXPECT_LE(twin.weights_off(), kSame);
  EXPECT_GE(twin.size(), 0.1);
}

TEST(FullBody, IsTheReferenceOfSeveralDensities) {
  for (const bool regions : {false, true}) {
    Twin twin({.bar = {.cells = {4, 1, 1}, .density_gradient = 3},
               .integrator = Integrator::kBackwardEuler,
               .examples = 3,
               .regions = regions,
               .damping = 0.5});
    EXPECT_LE(twin.difference(60), kSame) << regions;
    EXPECT_LE(twin.weights_off(), kSame) << regions;
    EXPECT_GE(twin.size(), 0.1);
  }
}

TEST(FullBody, IsTheReferenceWithElasticExamples) {
  for (const MaterialModel material :
       {MaterialModel::kStVenantKirchhoff, MaterialModel::kStableNeoHookean, MaterialModel::kCorotational}) {
    Twin twin({.bar = {.cells = {4, 1, 1}, .material = material}, .examples = 3, .elastic = true, .damping = 0.5});
    EXPECT_LE(twin.difference(60), kSame);
    EXPECT_LE(twin.weights_off(), kSame);
    EXPECT_GE(twin.size(), 0.1);
  }
}

TEST(FullBody, IsTheReferenceWithExamplesOfRegions) {
  Twin twin({.examples = 3, .regions = true, .damping = 0.5});
  EXPECT_LE(twin.difference(60), kSame);
  EXPECT_LE(twin.weights_off(), kSame);
  EXPECT_GE(twin.size(), 0.1);
}

// Backward Euler throughout: with another integrator the two may come near, and change to it, in different steps. The
// springs of contacts are stiff.
TEST(FullBody, IsTheReferenceOnAFloor) {
  Twin twin({.integrator = Integrator::kBackwardEuler, .floor = true});
  EXPECT_LE(twin.difference(80), 10 * kSame);
  EXPECT_GE(twin.contacts(), 20);
}

/// Turned and turning.
runtime::FrameMotion tumbling() {
  runtime::FrameMotion motion;
  motion.position = {0.1, 0.4, -0.2};
  motion.orientation = Eigen::AngleAxisd(1.1, Eigen::Vector3d(1, 2, -1).normalized());
  motion.linear_velocity = {0.3, 1, 0.2};
  motion.angular_velocity = {2, -1, 3};
  return motion;
}

/// Ratio of the difference of the two to that with half the time step.
double convergence(TwinOptions options, int steps) {
  Twin coarse(options);
  options.time_step *= 0.5;
  Twin fine(options);
  const double before = coarse.difference(steps), now = fine.difference(2 * steps);
  EXPECT_LE(before, 5e-3);
  return before / now;
}

// Newmark's method begins by a step of backward Euler here, there by the acceleration that the forces make.
TEST(FullBody, IsTheReferenceByNewmarksMethodButForItsFirstStep) {
  EXPECT_GE(convergence({.integrator = Integrator::kNewmark, .examples = 3, .damping = 0.5}, 60), 3.4);
}

// The reference loses angular momentum to its integrator, which is of second order, where the body here keeps it.
TEST(FullBody, IsTheReferenceInFreeFlightButForTheIntegrator) {
  const test::BarOptions bar{.cells = {4, 1, 1}, .free = true};
  EXPECT_GE(convergence({.bar = bar, .motion = tumbling()}, 60), 3.4);
  EXPECT_GE(convergence({.bar = bar, .examples = 3, .damping = 0.5, .motion = tumbling()}, 60), 3.4);
  EXPECT_GE(convergence({.bar = bar, .examples = 3, .regions = true, .damping = 0.5, .motion = tumbling()}, 60), 3.4);
}

// Near obstacles it is of first order, and when a vertex touches differs by a step: half as much at half this time
// step.
TEST(FullBody, IsTheReferenceWhereAFreeBodyLandsButForTheIntegrator) {
  Twin twin({.bar = {.cells = {4, 1, 1}, .free = true},
             .integrator = Integrator::kBackwardEuler,
             .floor = true,
             .friction = 0.3,
             .time_step = 0.000625});
  EXPECT_LE(twin.difference(640), 2e-3);
  EXPECT_GE(twin.contacts(), 1000);
}

TEST(FullBody, KeepsItsMomentaInFreeFlight) {
  Twin twin({.bar = {.cells = {4, 1, 1}, .free = true}, .examples = 3, .damping = 0.5, .motion = tumbling()});
  runtime::StepScene scene = twin.scene();
  scene.gravity.setZero();
  scene.forces.clear();
  runtime::Workspace workspace(twin.model(), scene);
  runtime::FullWorkspace own(twin.full(), scene, runtime::kRealTime);
  scene.space.newton = runtime::SpaceSettings{}.newton;
  runtime::State& state = twin.state();
  const runtime::FrameMomenta start = *twin.model().frame->momenta(state.frame);
  for (int i = 0; i < 10000; ++i)
    ASSERT_EQ(runtime::step_in_full_space(twin.full(), twin.model(), scene, state, workspace, own).status, 0U);
  const runtime::FrameMomenta end = *twin.model().frame->momenta(state.frame);
  EXPECT_LE((end.linear - start.linear).norm(), 1e-10 * start.linear.norm());
  EXPECT_LE((end.angular - start.angular).norm(), 1e-10 * start.angular.norm());
}

// The basis holds all: what goes into full space comes back.
TEST(FullBody, EntersAndLeavesWhereItIs) {
  for (const bool free : {false, true}) {
    Twin twin({.bar = {.cells = {3, 1, 1}, .free = free}});
    const runtime::Model& model = twin.model();
    runtime::State state =
        runtime::make_state(model, 0.3 * test::random_vector(model.modes(), 3), test::random_vector(model.modes(), 4));
    if (free) runtime::set_motion(model, tumbling(), state);
    const runtime::State before = state;
    runtime::enter_full_space(twin.full(), model, state);
    runtime::StepScene scene;
    scene.time_step = 1e-10;  // elasticity changes v by 1e5 m/s^2 of that, rounding by 1e-16 m over it
    runtime::Workspace workspace(model, scene);
    runtime::FullWorkspace own(twin.full(), scene);
    ASSERT_EQ(runtime::step_in_full_space(twin.full(), model, scene, state, workspace, own).status & 1U, 0U);
    runtime::leave_full_space(state);
    EXPECT_LE((state.q - before.q).norm(), 1e-6 * before.q.norm());
    EXPECT_LE((state.v - before.v).norm(), 1e-4 * before.v.norm());
    if (!free) continue;
    const auto now = *model.frame->momenta(state.frame), then = *model.frame->momenta(before.frame);
    EXPECT_LE((now.linear - then.linear).norm(), 1e-12 * then.linear.norm());
    EXPECT_LE((now.angular - then.angular).norm(), 1e-12 * then.angular.norm());
  }
}

/// A carried bar under a push in the space of all its vertices and in that of all its modes, whose equations are those
/// of the frame: fictitious forces in place of inertia in the world.
struct CarriedTwin {
  explicit CarriedTwin(int examples, bool elastic = false)
      : bar(complete_bar({.cells = {4, 1, 1}, .carried = true, .examples = examples})),
        has_examples(examples > 0),
        is_elastic(elastic) {
    if (has_examples) bar.model.full_space = full_space_data_of(bar.model);
    if (elastic) make_elastic(bar.model);
    model = std::move(
        runtime::build_model(bar.model, {.examples = has_examples, .elastic = elastic, .carried = true}).model);
    full = std::move(runtime::build_full_model(bar.model, *model).model);
  }

  runtime::StepScene scene(double time_step, Integrator integrator) const {
    const Eigen::Vector3d axis = Eigen::Vector3d(0.4, -0.3, 0.8).normalized();
    const auto turned = [&](double angle) { return Eigen::Quaterniond(Eigen::AngleAxisd(angle, axis)); };
    runtime::StepScene scene;
    scene.time_step = time_step;
    scene.integrator = integrator;
    scene.mass_damping = 0.5;
    scene.stiffness_damping = 0.005;
    scene.newton = scene.space.newton = {100, kTight};
    scene.gravity = {0, -9, 3};
    scene.gravity_force = runtime::gravity_force(*model, scene.gravity);
    scene.carrier = runtime::RigidMotion(std::vector<runtime::Keyframe>{
        {0, {0, 0, 0}, turned(0)}, {0.16, {0.1, 0.2, -0.1}, turned(0.9)}, {0.32, {-0.1, 0.3, 0.2}, turned(1.6)}});
    if (has_examples)
      scene.examples = {{.stiffness = is_elastic ? 2.0 : 300.0,
                         .damping = 2,
                         .bias = 0.4,
                         .target_iterations = 50,
                         .elastic = is_elastic}};
    return scene;
  }

  runtime::State start(const runtime::StepScene& scene) const {
    runtime::State state = runtime::make_state(*model);
    runtime::FrameWorkspace frame = model->frame->make_workspace();
    model->frame->follow(scene, 0, state.q, state.v, frame, state.frame);
    return state;
  }

  /// Largest distance of the two after 0.32 s over the largest displacement in the frame.
  double difference(double time_step, Integrator integrator = Integrator::kBdf2) const {
    const runtime::StepScene of = scene(time_step, integrator);
    runtime::State reduced = start(of), state = reduced;
    runtime::enter_full_space(*full, *model, state);
    runtime::Workspace workspace(*model, of), beside(*model, of);
    runtime::FullWorkspace own(*full, of);
    for (int i = 0; i < static_cast<int>(std::lround(0.32 / time_step)); ++i) {
      EXPECT_EQ(runtime::step_in_full_space(*full, *model, of, state, workspace, own).status, 0U) << i;
      EXPECT_EQ(runtime::step(*model, of, reduced, beside).status, 0U) << i;
    }
    const double size = (full->basis * reduced.q).lpNorm<Eigen::Infinity>();
    EXPECT_GE(size, 0.02);
    const runtime::Energies now = runtime::energies(full.get(), *model, of, state),
                            expected = runtime::energies(*model, of, reduced);
    energies_off = std::max({std::abs(now.kinetic / expected.kinetic - 1), std::abs(now.elastic / expected.elastic - 1),
                             std::abs(now.potential / expected.potential - 1)});
    coordinates_off = (state.q - reduced.q).norm() / reduced.q.norm();
    fixed_off = 0;
    const VertexArray& rest = bar.model.object->mesh.vertices;
    for (Eigen::Index v = 0; v < rest.rows(); ++v) {
      if (bar.model.object->fixed[v] == 0) continue;
      const Eigen::Vector3d moved =
          runtime::full_displacement(*full, model->frame->placement(state.frame), *state.full, v);
      fixed_off = std::max(
          fixed_off,
          (rest.row(v).transpose() + moved - of.carrier->sample(state.time).to_world(rest.row(v).transpose())).norm());
    }
    runtime::enter_full_space(*full, *model, reduced);
    return (state.full->q - reduced.full->q).lpNorm<Eigen::Infinity>() / size;
  }

  test::Bar bar;
  bool has_examples, is_elastic;
  std::unique_ptr<const runtime::Model> model;
  std::unique_ptr<const runtime::FullModel> full;
  mutable double energies_off = 0, coordinates_off = 0, fixed_off = 0;
};

// Both are of second order, of errors of their own: a quarter as far apart at half the time step, a little less where
// weights change.
TEST(FullBody, IsTheReducedBodyOfAllModesWhereItIsCarried) {
  for (const auto& [examples, elastic] : {std::pair(0, false), std::pair(3, false), std::pair(3, true)}) {
    SCOPED_TRACE(testing::Message() << examples << " examples, elastic " << elastic);
    const CarriedTwin twin(examples, elastic);
    const double coarse = twin.difference(0.002), fine = twin.difference(0.001);
    EXPECT_GE(coarse / fine, 3.4);
    EXPECT_LE(fine, 5e-3);
    EXPECT_LE(twin.energies_off, 1e-2);
    EXPECT_LE(twin.coordinates_off, 1e-2);
    EXPECT_LE(twin.fixed_off, 1e-15);
  }
}

// A body of a world steps in the space that its scene says, and in `auto` in the full one while a force of the caller
// acts and for `release` after it.
TEST(FullBody, StepsInTheSpaceThatAWorldChooses) {
  Twin twin({.bar = {.cells = {3, 1, 1}}});
  runtime::StepScene scene = twin.scene();
  scene.forces.clear();
  scene.space = {Space::kAuto, 0.1, true, true, {20, 0.01}};
  runtime::State state = runtime::make_state(twin.model());
  runtime::prepare_full(twin.full(), state);
  runtime::World world({});
  world.add({&twin.model(), &scene, nullptr, &twin.full()}, state);
  const auto space_after = [&](int steps) {
    for (int i = 0; i < steps; ++i) {
      world.step(1);
      EXPECT_EQ(world.report(0).status, 0U);
    }
    return world.state(0).full ? Space::kFull : Space::kReduced;
  };
  EXPECT_EQ(space_after(3), Space::kReduced);
  state.vertex_force.tail<3>() = Eigen::Vector3d(0, 5, 0);
  state.applied_force = twin.full().basis.transpose() * state.vertex_force;
  EXPECT_EQ(space_after(1), Space::kFull);
  EXPECT_EQ(space_after(50), Space::kFull);
  state.vertex_force.setZero();
  state.applied_force.setZero();
  EXPECT_EQ(space_after(19), Space::kFull);
  EXPECT_EQ(space_after(3), Space::kReduced);
  scene.space.space = Space::kFull;
  EXPECT_EQ(space_after(1), Space::kFull);
  scene.space.space = Space::kReduced;
  EXPECT_EQ(space_after(1), Space::kReduced);
}

}  // namespace full_body_test
}  // namespace exmat::precompute
