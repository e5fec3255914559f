#include "runtime/sim/step/example_forces.h"

#include <gtest/gtest.h>

#include "tests/support/allocation_counter.h"
#include "tests/support/scenes.h"

// Elastic forces; the linear ones are in stepper_test.cpp. Against the full space: full_space/reduced_test.cpp.

namespace exmat::runtime {
namespace {

class ElasticForce : public testing::TestWithParam<std::tuple<Integrator, bool>> {
 protected:
  ElasticForce()
      : model_(prepared(bar_, {.target_table = std::get<1>(GetParam()), .elastic = true})),
        scene_(free_scene(*model_, std::get<0>(GetParam()), 0.01)) {}

  State run(int steps) {
    State state = make_state(*model_);
    Workspace workspace(*model_, scene_);
    for (int i = 0; i < steps; ++i) EXPECT_EQ(step(*model_, scene_, state, workspace).status & kStepNonFinite, 0U) << i;
    return state;
  }

  const test::Bar bar_ = elastic_bar({.examples = 3});
  std::unique_ptr<const Model> model_;
  StepScene scene_;
};
INSTANTIATE_TEST_SUITE_P(IntegratorsAndTargets, ElasticForce,
                         testing::Combine(testing::ValuesIn(kIntegrators), testing::Bool()));

// Much stiffer than the material, the example holds the body where its target is: with one example left, in its pose.
TEST_P(ElasticForce, DrawsTheBodyToItsTarget) {
  if (std::get<0>(GetParam()) == Integrator::kNewmark) GTEST_SKIP() << "it keeps the fast vibrations";
  scene_.mass_damping = 20;
  scene_.examples = {{.stiffness = 1000, .damping = 30, .bias = 0, .elastic = true}};
  const State state = run(300);
  Eigen::VectorXd target = Eigen::VectorXd::Zero(model_->modes());
  for (std::size_t k = 0; k < 3; ++k)
    target += state.examples.front().weights[static_cast<Eigen::Index>(k)] * bar_.model.examples->examples[k].pose;
  ASSERT_GT(target.norm(), 0);
  // The blend is the table's target; the minimum that is solved for lies beside it.
  EXPECT_LE((state.q - target).norm(), (std::get<1>(GetParam()) ? 0.01 : 0.25) * target.norm());
}

TEST_P(ElasticForce, DoesNotAllocate) {
  if (!test::AllocationCounter::works()) GTEST_SKIP() << "a sanitizer owns malloc";
  scene_.examples = {{.stiffness = 2, .damping = 3, .bias = 0.4, .elastic = true}};
  State state = make_state(*model_);
  Workspace workspace(*model_, scene_);
  const test::AllocationCounter counter;
  for (int i = 0; i < 4; ++i) step(*model_, scene_, state, workspace);
  EXPECT_EQ(counter.count(), 0U);
}

// Without damping the filter has no part; without either the force is left out.
TEST_P(ElasticForce, LeavesOutWhatIsZero) {
  scene_.gravity_force = gravity_force(*model_, {0, -9.81, 0});
  const State free = run(20);
  scene_.examples = {{.stiffness = 0, .damping = 0, .bias = 0.4, .elastic = true}};
  EXPECT_EQ(run(20).q, free.q);
  scene_.examples = {{.stiffness = 2, .damping = 0, .bias = 0.4, .elastic = true}};
  EXPECT_GT((run(20).q - free.q).norm(), 0.1 * free.q.norm());
}

// The force is the slope of the energy, where the body starts: the acceleration of Newmark's first step.
TEST(ElasticExampleForce, IsThatOfTheEnergyAtTheStart) {
  const test::Bar bar = elastic_bar({.examples = 2});
  const auto model = prepared(bar, {.target_table = true, .elastic = true});
  StepScene scene = free_scene(*model, Integrator::kNewmark, 1e-6);
  scene.examples = {{.stiffness = 0.5, .bias = 0, .elastic = true}};
  State state = make_state(*model);
  Workspace workspace(*model, scene);
  step(*model, scene, state, workspace);
  const Eigen::VectorXd& pose = bar.model.examples->examples[1].pose;
  const CubatureData& cubature = *bar.model.cubature;
  Eigen::VectorXd slope = Eigen::VectorXd::Zero(pose.size());
  for (Eigen::Index j = 0; j < cubature.weights.size(); ++j) {
    const auto B = cubature.gradient.middleRows<9>(9 * j);
    const Eigen::VectorXd flat = B * pose;
    const Eigen::Matrix3d target = Eigen::Matrix3d::Identity() + flat.reshaped<Eigen::RowMajor>(3, 3);
    const Eigen::Matrix3d inverse = target.inverse();
    const Eigen::Matrix3d P = test::first_piola_kirchhoff(MaterialModel::kStVenantKirchhoff, inverse,
                                                          cubature.youngs_modulus[j], cubature.poisson_ratio[j]) *
                              inverse.transpose();
    slope += 0.5 * cubature.weights[j] * cubature.volumes[j] * target.determinant() *
             (B.transpose() * Eigen::VectorXd(P.reshaped<Eigen::RowMajor>()));
  }
  EXPECT_LE((state.a + slope).norm(), 1e-4 * slope.norm());
}

TEST(ElasticExampleForce, NamesWhatABundleLacks) {
  test::Bar bar = elastic_bar({.examples = 3});
  bar.model.target_elasticity->control_points = RowMatrix(3, bar.modes());
  ModelResult result = build_model(bar.model, {.target_table = true, .elastic = true});
  EXPECT_EQ(result.complaint.place, "/target_elasticity/control_points");
  bar.model.target_elasticity.reset();
  result = build_model(bar.model, {.target_table = true, .elastic = true});
  EXPECT_FALSE(result.model);
  EXPECT_EQ(result.complaint.place, "/target_elasticity");
  EXPECT_NE(to_string(result.complaint).find("--scene"), std::string::npos);
}

}  // namespace
}  // namespace exmat::runtime
