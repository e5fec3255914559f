#include <Eigen/LU>
#include <cmath>
#include <gtest/gtest.h>
#include <tuple>

#include "common/core/decompositions.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/random.h"
#include "tests/support/scenes.h"

namespace exmat::runtime {
namespace {

using test::Bar;

constexpr MaterialModel kModels[] = {MaterialModel::kStVenantKirchhoff, MaterialModel::kStableNeoHookean,
                                     MaterialModel::kCorotational};

class MaterialsTest : public ::testing::TestWithParam<MaterialModel> {};
INSTANTIATE_TEST_SUITE_P(Each, MaterialsTest, ::testing::ValuesIn(kModels),
                         [](const auto& test) { return std::string(name_of(test.param)); });

double largest_displacement(const Bar& bar, const Eigen::VectorXd& q) {
  return (bar.basis() * q).reshaped<Eigen::RowMajor>(bar.basis().rows() / 3, 3).rowwise().norm().maxCoeff();
}

/// A pose whose largest displacement is a share of the bar's size.
Eigen::VectorXd pose(const Bar& bar, std::uint32_t seed, double share) {
  Eigen::VectorXd q = test::random_vector(bar.modes(), seed);
  for (Eigen::Index i = 0; i < q.size(); ++i) q[i] /= static_cast<double>((i + 1) * (i + 1));
  return q * (share * bar.length / largest_displacement(bar, q));
}

TEST_P(MaterialsTest, ForceIsTheProjectedForceOfTheFullSpace) {
  const Bar bar = test::make_bar({.material = GetParam(), .examples = 4});
  const auto model = prepared(bar, {.examples = false});
  auto workspace = model->internal_force.make_workspace();
  for (std::uint32_t seed = 0; seed < 5; ++seed) {
    const Eigen::VectorXd q = pose(bar, seed, 0.3);
    Eigen::VectorXd force(bar.modes());
    model->internal_force.force(q, workspace, force);
    const Eigen::VectorXd expected = bar.basis().transpose() * test::full_internal_force(bar, bar.basis() * q);
    EXPECT_LE((force - expected).norm(), 1e-11 * expected.norm());
  }
}

TEST_P(MaterialsTest, ProjectedStiffnessIsPositiveSemidefiniteAndEqualWhereTheExactOneIs) {
  const Bar bar = test::make_bar({.material = GetParam(), .examples = 4});
  const ReducedElasticity elasticity(GetParam(), *bar.model.cubature);
  auto workspace = elasticity.make_workspace();
  Eigen::MatrixXd exact = Eigen::MatrixXd::Zero(bar.modes(), bar.modes()), projected = exact;
  const auto lowest = [](const Eigen::MatrixXd& lower) {
    return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(lower).eigenvalues().minCoeff();
  };
  // Less than half its length.
  const Eigen::VectorXd compressed = -4 * bar.basis().transpose() * bar.mass * bar.example_fields[3];
  elasticity.stiffness(compressed, Tangent::kExact, workspace, exact);
  elasticity.stiffness(compressed, Tangent::kPositiveSemidefinite, workspace, projected);
  ASSERT_LT(lowest(exact), 0) << "the pose is too mild for this test";
  EXPECT_GE(lowest(projected), -1e-10 * projected.norm());
  const Eigen::VectorXd rest = Eigen::VectorXd::Zero(bar.modes());
  elasticity.stiffness(rest, Tangent::kExact, workspace, exact);
  elasticity.stiffness(rest, Tangent::kPositiveSemidefinite, workspace, projected);
  EXPECT_LE((exact - projected).norm(), 1e-12 * exact.norm());
}

/// The displacement at which the bar comes to rest under gravity.
Eigen::VectorXd hanging(MaterialModel material, double gravity) {
  const Bar bar = test::make_bar({.material = material});
  const auto model = prepared(bar);
  StepScene scene = free_scene(*model, Integrator::kBackwardEuler, 1e6);  // statics
  scene.newton = {100, 1e-13};
  scene.gravity_force = gravity_force(*model, {0, -gravity, 0.3 * gravity});
  State state = make_state(*model);
  Workspace workspace(*model, scene);
  for (int i = 0; i < 3; ++i) step(*model, scene, state, workspace);
  return state.q;
}

// Materials of the same linearisation differ by the square of the load: half the load, half the relative difference.
TEST_P(MaterialsTest, AgreesWithTheOthersToFirstOrder) {
  const auto difference = [](double gravity) {
    const Eigen::VectorXd expected = hanging(MaterialModel::kStVenantKirchhoff, gravity);
    return (hanging(GetParam(), gravity) - expected).norm() / expected.norm();
  };
  if (GetParam() == MaterialModel::kStVenantKirchhoff) {
    EXPECT_EQ(difference(1), 0);
    return;
  }
  const double coarse = difference(0.02), fine = difference(0.01);
  EXPECT_LE(coarse, 1e-2);
  EXPECT_GT(fine, 1e-8) << "nothing to see";
  EXPECT_NEAR(coarse / fine, 2, 0.1);
}

/// One tet on three fixed vertices, its apex free: three modes.
ReducedModel single_tet(MaterialModel material) {
  ReducedModel model;
  ObjectData& object = model.object.emplace();
  object.mesh.vertices.resize(4, 3);
  object.mesh.vertices << 0, 0, 0, 1, 0, 0, 0, 1, 0, 0.2, 0.3, 1;
  object.mesh.tets.resize(1, 4);
  object.mesh.tets << 0, 1, 2, 3;
  object.materials.model = material;
  constexpr double kDensity = 1000, kVolume = 1.0 / 6, kMass = kDensity * kVolume / 10;
  ModalData& modal = model.modal.emplace();
  modal.basis = RowMatrix::Zero(12, 3);
  modal.basis.bottomRows<3>() = Eigen::Matrix3d::Identity() / std::sqrt(kMass);
  modal.gravity_load = RowMatrix::Zero(3, 3);
  CubatureData& cubature = model.cubature.emplace();
  cubature.elements = IndexVector::Zero(1);
  cubature.weights = Eigen::VectorXd::Ones(1);
  cubature.volumes = Eigen::VectorXd::Constant(1, kVolume);
  cubature.youngs_modulus = Eigen::VectorXd::Constant(1, 1e5);
  cubature.poisson_ratio = Eigen::VectorXd::Constant(1, 0.3);
  // The apex's shape function is z.
  cubature.gradient = RowMatrix::Zero(9, 3);
  for (int axis = 0; axis < 3; ++axis) cubature.gradient(3 * axis + 2, axis) = 1 / std::sqrt(kMass);
  return model;
}

// St.Venant-Kirchhoff does not feel a reflection: it stays inverted. The others come back.
TEST_P(MaterialsTest, AnInvertedElementRecovers) {
  const auto result = build_model(single_tet(GetParam()), {});
  ASSERT_TRUE(result.model) << to_string(result.complaint);
  const Model& model = *result.model;
  for (const double height : {-0.3, -1.05, -2.0}) {
    StepScene scene = free_scene(model, Integrator::kBackwardEuler, 0.01);
    scene.mass_damping = 2;
    const double unit = 1 / single_tet(GetParam()).modal->basis(9, 0);
    const Eigen::Vector3d inverted = unit * Eigen::Vector3d(0.1, -0.05, height - 1);
    State state = make_state(model, inverted, Eigen::Vector3d::Zero());
    Workspace workspace(model, scene);
    for (int i = 0; i < 1000; ++i) ASSERT_EQ(step(model, scene, state, workspace).status & kStepNonFinite, 0U) << i;
    if (GetParam() == MaterialModel::kStVenantKirchhoff && height == -1.05) {
      EXPECT_NEAR(state.q[2], -2 * unit, 0.01 * unit);
    } else if (GetParam() != MaterialModel::kStVenantKirchhoff) {
      EXPECT_LE(state.q.norm(), 1e-3 * unit) << height;
    }
  }
}

class MaterialExtremes : public ::testing::TestWithParam<std::tuple<MaterialModel, Integrator, double, double>> {};
INSTANTIATE_TEST_SUITE_P(All, MaterialExtremes,
                         ::testing::Combine(::testing::ValuesIn(kModels), ::testing::ValuesIn(kIntegrators),
                                            ::testing::Values(1e3, 1e6, 1e9, 1e12),
                                            ::testing::Values(-0.3, 0.0, 0.3, 0.499)));

// Soft ones fold up under gravity, stiff ones hardly move.
TEST_P(MaterialExtremes, StayFinite) {
  const auto [material, integrator, youngs_modulus, poisson_ratio] = GetParam();
  const Bar bar = test::make_bar(
      {.cells = {4, 2, 2}, .youngs_modulus = youngs_modulus, .poisson_ratio = poisson_ratio, .material = material});
  const auto model = prepared(bar);
  StepScene scene = free_scene(*model, integrator, 0.005);
  scene.mass_damping = 0.1;
  scene.gravity_force = gravity_force(*model, {3, -9.81, 1});
  State state = make_state(*model);
  Workspace workspace(*model, scene);
  for (int i = 0; i < 60; ++i) {
    ASSERT_EQ(step(*model, scene, state, workspace).status & kStepNonFinite, 0U) << i;
    ASSERT_LE(largest_displacement(bar, state.q), 8 * bar.length) << i;
  }
  EXPECT_GT(state.q.norm(), 0);
}

TEST_P(MaterialsTest, StepsWithTargetsDoNotAllocate) {
  if (!test::AllocationCounter::works()) GTEST_SKIP() << "a sanitizer owns malloc";
  const Bar bar = test::make_bar({.material = GetParam(), .examples = 3});
  for (const auto reference : {EnergyReference::kExample, EnergyReference::kRest}) {
    const auto model = prepared(bar, {.energy_reference = reference});
    StepScene scene = free_scene(*model, Integrator::kBdf2, 0.02);
    scene.gravity_force = gravity_force(*model, {80, -400, 100});  // violent: tangents have to be projected
    scene.examples = {ExampleSettings{300, 4, 0.5}};
    State state = make_state(*model);
    Workspace workspace(*model, scene);
    const test::AllocationCounter counter;
    for (int i = 0; i < 30; ++i) step(*model, scene, state, workspace);
    EXPECT_EQ(counter.count(), 0U);
    auto elasticity = model->internal_force.make_workspace();
    const std::size_t before = counter.count();
    model->internal_force.stiffness(state.q, Tangent::kPositiveSemidefinite, elasticity, workspace.newton.hessian);
    EXPECT_EQ(counter.count(), before);
  }
}

TEST_P(MaterialsTest, NonFiniteInputSetsTheBitAndKeepsTheState) {
  const Bar bar = test::make_bar({.material = GetParam()});
  const auto model = prepared(bar);
  for (const double poison : {std::nan(""), HUGE_VAL, 1e300}) {
    StepScene scene = free_scene(*model, Integrator::kBdf2, 0.01);
    State state = make_state(*model);
    Workspace workspace(*model, scene);
    step(*model, scene, state, workspace);
    const Eigen::VectorXd sound = state.q;
    state.v[0] = poison;
    EXPECT_NE(step(*model, scene, state, workspace).status & kStepNonFinite, 0U) << poison;
    EXPECT_EQ(state.q, sound);
  }
}

}  // namespace
}  // namespace exmat::runtime
