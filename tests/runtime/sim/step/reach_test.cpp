#include "runtime/sim/step/reach.h"

#include <cmath>
#include <gtest/gtest.h>
#include <limits>

#include "tests/support/allocation_counter.h"
#include "tests/support/random.h"
#include "tests/support/scenes.h"

// Weights as muscles, beside steps with other weights and beside all weights of a grid.
namespace exmat::runtime {
namespace reach_test {

struct Posed {
  Posed(const test::BarOptions& options, bool elastic)
      : bar(elastic_bar(options)), model(prepared(bar, {.target_table = elastic, .elastic = elastic})) {
    scene.time_step = 0.004;
    scene.newton.tolerance = 1e-11;
    scene.mass_damping = 12;
    scene.stiffness_damping = 0.002;
    scene.gravity = {0, 0, options.free ? 0 : -2.0};
    scene.gravity_force = gravity_force(*model, scene.gravity);
    ExampleSettings& examples = scene.examples.emplace_back();
    examples.stiffness = elastic ? 0.5 : 400;
    examples.elastic = elastic;
    state = make_state(*model);
    scratch.emplace(*model, scene);
    rest.resize(2, 3);
    rows.resize(6, model->modes());
    for (const Eigen::Index i : {0, 1}) {
      const Eigen::Index vertex = i == 0 ? tip() : tip() / 2;
      rest.row(i) = bar.model.object->mesh.vertices.row(vertex);
      rows.middleRows<3>(3 * i) = bar.basis().middleRows<3>(3 * vertex);
    }
  }

  Eigen::Index tip() const {
    Eigen::Index found = 0;
    bar.model.object->mesh.vertices.col(0).maxCoeff(&found);
    return found;
  }
  void give(const Eigen::VectorXd& weights) { scene.examples.front().given_weights = weights; }
  void step(int steps) {
    for (int i = 0; i < steps; ++i) runtime::step(*model, scene, state, *scratch);
  }
  Eigen::VectorXd places(const State& of) const {
    Eigen::VectorXd places(6);
    for (const Eigen::Index i : {0, 1})
      places.segment<3>(3 * i) =
          model->frame->placement(of.frame).to_world(rest.row(i).transpose() + rows.middleRows<3>(3 * i) * of.q);
    return places;
  }
  ReachTargets targets(const Eigen::VectorXd& where) const {
    const Eigen::Index examples = model->example_count();
    return {0, rest, rows, where, Eigen::VectorXd::Zero(examples), Eigen::VectorXd::Ones(examples), 0.02, 0.5};
  }

  test::Bar bar;
  std::unique_ptr<const Model> model;
  StepScene scene;
  State state;
  std::optional<Workspace> scratch;
  VertexArray rest;
  RowMatrix rows;
};

constexpr double kWeights[] = {0.4, 0.35, 0.25};

class Sensitivity : public ::testing::TestWithParam<std::tuple<Integrator, bool, bool>> {};
INSTANTIATE_TEST_SUITE_P(Bars, Sensitivity,
                         ::testing::Combine(::testing::Values(Integrator::kBdf2, Integrator::kBackwardEuler,
                                                              Integrator::kNewmark),
                                            ::testing::Bool(), ::testing::Bool()));

// Steps with weights moved by 1e-4 either way differ by S times that: to 2e-4 of the displacement, as S is of the shape
// where the step begins, of a body at rest. A free body of BDF2 turns by the midpoint rule all the same, for which the
// duration is another one: to 1 %.
TEST_P(Sensitivity, IsThatOfAStep) {
  const auto& [integrator, elastic, free] = GetParam();
  Posed body({.youngs_modulus = 4e5, .free = free, .examples = 3}, elastic);
  body.scene.integrator = integrator;
  const Eigen::Vector3d weights(kWeights);
  body.give(weights);
  body.step(800);
  const double dt = body.scene.time_step;
  const double h = integrator == Integrator::kBdf2 ? 2 * dt / 3 : integrator == Integrator::kNewmark ? dt / 2 : dt;
  WeightResponse response(*body.model, body.scene, body.state, 0);
  response.update(h, Tangent::kExact);
  const Eigen::MatrixXd S = response.response().jacobian({body.rest, body.rows}) * response.ways().leftCols(3);
  constexpr double kMoved = 1e-4;
  const double tolerance = free && integrator == Integrator::kBdf2 ? 1e-2 : 2e-4;
  for (const Eigen::Index k : {1, 2}) {
    Eigen::VectorXd ends[2];
    for (const int side : {0, 1}) {
      const State before = body.state;
      Eigen::Vector3d moved = weights;
      moved[0] -= (side == 0 ? -1 : 1) * kMoved;
      moved[k] += (side == 0 ? -1 : 1) * kMoved;
      body.give(moved);
      body.step(1);
      ends[side] = body.places(body.state);
      body.state = before;
    }
    const Eigen::VectorXd expected = (ends[1] - ends[0]) / (2 * kMoved), found = S.col(k) - S.col(0);
    EXPECT_GT(expected.norm(), 1e-7);
    EXPECT_LE((found - expected).norm(), tolerance * expected.norm())
        << k << ": " << found.transpose() << " against " << expected.transpose();
  }
}

/// Where the body settles with these weights, whatever its time step.
Eigen::VectorXd settled(Posed& body, const Eigen::VectorXd& weights) {
  body.scene.time_step = 0.02;
  body.give(weights);
  body.step(60);
  return body.places(body.state);
}

class Reaching : public ::testing::TestWithParam<bool> {};
INSTANTIATE_TEST_SUITE_P(Bars, Reaching, ::testing::Bool(),
                         [](const auto& test) { return test.param ? "elastic" : "linear"; });

// All weights in steps of 1/8, and about the best of them in steps of 1/32, are what nothing of the method has made.
TEST_P(Reaching, IsAsGoodAsTheBestOfAllWeights) {
  Posed body({.youngs_modulus = 4e5, .examples = 3}, GetParam());
  Posed search({.youngs_modulus = 4e5, .examples = 3}, GetParam());
  const Eigen::VectorXd start = body.places(body.state);
  Eigen::VectorXd reachable = settled(search, Eigen::Vector3d(0.3, 0.5, 0.2));
  for (const bool out_of_reach : {false, true}) {
    Eigen::VectorXd where = reachable;
    if (out_of_reach) where += 0.2 * body.bar.length * test::random_vector(6, 3).normalized();
    double best = std::numeric_limits<double>::infinity();
    Eigen::Vector3d best_weights(1, 0, 0);
    const auto look = [&](const Eigen::Vector3d& centre, int cells, double width) {
      for (int i = 0; i <= cells; ++i)
        for (int j = 0; j <= cells; ++j) {
          const double a = centre[1] + width * (i - (width < 1 ? cells / 2.0 : 0)) / cells;
          const double b = centre[2] + width * (j - (width < 1 ? cells / 2.0 : 0)) / cells;
          if (a < 0 || b < 0 || a + b > 1) continue;
          const Eigen::Vector3d weights(1 - a - b, a, b);
          const double distance = (settled(search, weights) - where).norm();
          if (distance < best) best = distance, best_weights = weights;
        }
    };
    look(Eigen::Vector3d::Zero(), 8, 1);
    look(best_weights, 8, 1 / 4.0);

    Reach reach(*body.model, body.scene, body.state, body.targets(where));
    for (int i = 0; i < 300; ++i) {
      reach.choose_weights(body.scene);
      body.step(1);
    }
    const double distance = (body.places(body.state) - where).norm();
    EXPECT_LE(distance, best + 0.01 * body.bar.length) << "against " << best << " of " << best_weights.transpose();
    if (!out_of_reach) EXPECT_LE(distance, 1e-3 * body.bar.length);
    EXPECT_LE(body.state.v.norm(), 5e-3) << "it has settled";
    EXPECT_NEAR(body.scene.examples.front().given_weights.sum(), 1, 1e-12);
    EXPECT_GE(body.scene.examples.front().given_weights.minCoeff(), 0);
  }
  EXPECT_GT((start - reachable).norm(), 0.05 * body.bar.length) << "there is something to reach";
}

TEST(ReachTest, StaysWithinItsLimits) {
  Posed body({.youngs_modulus = 4e5, .examples = 4}, false);
  Posed there({.youngs_modulus = 4e5, .examples = 4}, false);
  ReachTargets targets = body.targets(settled(there, Eigen::Vector4d(0, 1, 0, 0)));
  targets.highest << 1, 0.4, 0.3, 1;
  targets.lowest << 0, 0, 0.1, 0;
  targets.change = 0.02;
  Reach reach(*body.model, body.scene, body.state, targets);
  Eigen::VectorXd before;
  for (int i = 0; i < 200; ++i) {
    reach.choose_weights(body.scene);
    const Eigen::VectorXd& now = body.scene.examples.front().given_weights;
    EXPECT_NEAR(now.sum(), 1, 1e-12);
    EXPECT_LE((now - targets.highest).maxCoeff(), 1e-12);
    EXPECT_GE((now - targets.lowest).minCoeff(), -1e-12);
    if (before.size() > 0) EXPECT_LE((now - before).cwiseAbs().maxCoeff(), 0.02 + 1e-12) << i;
    before = now;
    body.step(1);
  }
  EXPECT_NEAR(before[1], 0.4, 1e-6) << "as much of it as is allowed";
}

TEST(ReachTest, AllocatesNothing) {
  if (!test::AllocationCounter::works()) GTEST_SKIP();
  for (const bool elastic : {false, true}) {
    Posed body({.youngs_modulus = 4e5, .free = true, .examples = 3}, elastic);
    body.give(Eigen::Vector3d(kWeights));
    body.step(3);
    Reach reach(*body.model, body.scene, body.state, body.targets(body.places(body.state)));
    reach.choose_weights(body.scene);
    const test::AllocationCounter counter;
    reach.choose_weights(body.scene);
    EXPECT_EQ(counter.count(), 0U);
  }
}

}  // namespace reach_test
}  // namespace exmat::runtime
