#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <omp.h>
#include <optional>

#include "common/core/error.h"
#include "runtime/scene/bodies.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/scenes.h"

namespace exmat::runtime {
namespace {

constexpr int kBodies = 5;

/// The number of threads that OpenMP gives, for as long as this lives.
class ThreadCount {
 public:
  explicit ThreadCount(int threads) : former_(omp_get_max_threads()) { omp_set_num_threads(threads); }
  ~ThreadCount() { omp_set_num_threads(former_); }
  ThreadCount(const ThreadCount&) = delete;
  ThreadCount& operator=(const ThreadCount&) = delete;

 private:
  int former_;
};

enum class Target { kNone, kTable, kSolve };

/// Another push on each body, so that no two are alike.
void push(Bodies& bodies, const StepScene& scene) {
  for (int body = 0; body < bodies.count(); ++body)
    bodies.world().state(body).applied_force = 0.1 * body * scene.gravity_force.reverse();
}

class InstancesTest : public ::testing::TestWithParam<std::tuple<Target, bool>> {
 protected:
  InstancesTest() {
    const auto [target, polynomial] = GetParam();
    const test::Bar bar = full_bar({.cells = {3, 1, 1}, .linear_modes = 4, .eigenfunctions = 3, .examples = 3});
    LoadedScene& kind = loaded_.kinds.emplace_back().loaded;
    kind.model = prepared(bar, {.target_table = target == Target::kTable, .polynomial = polynomial});
    model_ = kind.model.get();
    kind.start = make_state(*model_);
    scene_ = free_scene(*model_, Integrator::kBdf2, 0.005);
    scene_.mass_damping = 0.05;
    scene_.gravity_force = gravity_force(*model_, {0, -9.81, 0});
    if (target != Target::kNone) scene_.examples = {ExampleSettings{300, 0.1, 0.5, 4}};
    kind.scene = scene_;
    loaded_.bodies.resize(kBodies);
    config_.time_step = scene_.time_step;
  }

  Bodies make_bodies() const { return {loaded_, config_}; }

  std::uint64_t hash_after(int steps, int threads) const {
    const ThreadCount limited(threads);
    Bodies bodies = make_bodies();
    EXPECT_EQ(bodies.threads(), threads);
    push(bodies, scene_);
    for (int i = 0; i < steps; ++i) bodies.step();
    EXPECT_TRUE(bodies.is_finite());
    return bodies.hash();
  }

  LoadedWorld loaded_;
  WorldConfig config_;
  const Model* model_ = nullptr;
  StepScene scene_;
};

std::string name_of(const ::testing::TestParamInfo<std::tuple<Target, bool>>& test) {
  const auto [target, polynomial] = test.param;
  const char* const name = target == Target::kNone ? "NoExamples" : target == Target::kTable ? "Table" : "Solve";
  return std::string(name) + (polynomial ? "Polynomial" : "Cubature");
}

INSTANTIATE_TEST_SUITE_P(All, InstancesTest,
                         ::testing::Combine(::testing::Values(Target::kNone, Target::kTable, Target::kSolve),
                                            ::testing::Bool()),
                         name_of);

TEST_P(InstancesTest, StatesAreTheSameWithOneThreadAndTwoAfterTenThousandSteps) {
  EXPECT_EQ(hash_after(10000, 1), hash_after(10000, 2));
}

TEST_P(InstancesTest, ThreadsMayOutnumberCores) { EXPECT_EQ(hash_after(50, 1), hash_after(50, kBodies)); }

// By cubature side by side, where sums have another order: 1e-13 of a step, 50 of which follow each other.
TEST_P(InstancesTest, EachBodyMovesAsIfAlone) {
  const double rounding = can_step_side_by_side(*model_, scene_) ? 50 * 1e-13 : 0;
  const ThreadCount limited(2);
  Bodies bodies = make_bodies();
  push(bodies, scene_);
  for (int i = 0; i < 50; ++i) bodies.step();
  Workspace workspace(*model_, scene_);
  for (int body = 0; body < kBodies; ++body) {
    State alone = make_state(*model_);
    refresh_weights(*model_, scene_, alone, workspace);
    alone.applied_force = bodies.world().state(body).applied_force;
    for (int i = 0; i < 50; ++i) step(*model_, scene_, alone, workspace);
    EXPECT_LE((alone.q - bodies.world().state(body).q).norm(), rounding * alone.q.norm()) << body;
    EXPECT_LE((alone.v - bodies.world().state(body).v).norm(), rounding * alone.v.norm()) << body;
    if (!scene_.examples.empty()) {
      EXPECT_LE((alone.examples[0].weights - bodies.world().state(body).examples[0].weights).norm(), rounding) << body;
    }
    if (body > 0) {
      EXPECT_NE(bodies.world().state(body).q, bodies.world().state(body - 1).q);
    }
  }
}

TEST_P(InstancesTest, RestartTakesAllBodiesBack) {
  Bodies bodies = make_bodies();
  const std::uint64_t rest = bodies.hash();
  for (int i = 0; i < 20; ++i) bodies.step();
  const std::uint64_t later = bodies.hash();
  EXPECT_NE(later, rest);
  bodies.restart();
  EXPECT_EQ(bodies.hash(), rest);
  for (int i = 0; i < 20; ++i) bodies.step();
  EXPECT_EQ(bodies.hash(), later);
}

TEST_P(InstancesTest, MeasuringChangesNothingAndAllocatesNothing) {
  const ThreadCount limited(1);
  Bodies plain = make_bodies(), profiled = make_bodies();
  WorldProfile measured;
  profiled.world().set_profile(&measured);
  std::size_t allocations = 0;
  {
    const test::AllocationCounter counter;
    for (int i = 0; i < 20; ++i) {
      plain.step();
      profiled.step();
    }
    allocations = counter.count();
  }
  if (test::AllocationCounter::works()) {
    EXPECT_EQ(allocations, 0U);
  }
  EXPECT_EQ(plain.hash(), profiled.hash());
  EXPECT_GT(measured.bodies_seconds, 0);
  EXPECT_GT(measured.seconds[static_cast<std::size_t>(WorldStage::kSingleBodies)], 0);
  EXPECT_GT(measured.bodies.flops[static_cast<std::size_t>(Stage::kInternalForce)], 0);
  EXPECT_EQ(measured.bodies.seconds[static_cast<std::size_t>(Stage::kTarget)] > 0, !scene_.examples.empty());
}

TEST_P(InstancesTest, ABodyThatIsNotFiniteIsNamed) {
  Bodies bodies = make_bodies();
  bodies.world().state(3).applied_force[0] = 1e300;
  bodies.step();
  try {
    bodies.require_finite();
    FAIL();
  } catch (const WorkError& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("body 4 of 5"));
  }
}

}  // namespace
}  // namespace exmat::runtime
