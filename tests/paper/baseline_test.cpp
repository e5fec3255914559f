#include <Eigen/Geometry>
#include <cmath>
#include <gtest/gtest.h>
#include <numbers>

#include "common/core/error.h"
#include "common/mesh/geometry.h"
#include "tests/paper/minimiser.h"
#include "tests/paper/surface_energy.h"
#include "tests/paper/surface_targets.h"
#include "tests/precompute/full_space/full_space_bar.h"
#include "tests/support/box_mesh.h"
#include "tests/support/random.h"
#include "tests/support/sparse_space/step_potential.h"

namespace exmat::precompute {
namespace {

// Rosenbrock's function in pairs: least at (1, 1, ...), where it is 0.
TEST(Minimiser, FindsTheMinimumOfACurvedValley) {
  Eigen::VectorXd x = Eigen::VectorXd::Constant(6, -1.2);
  const auto function = [](const Eigen::VectorXd& at, Eigen::VectorXd& gradient) {
    double value = 0;
    for (Eigen::Index i = 0; i < at.size(); i += 2) {
      const double bend = at[i + 1] - at[i] * at[i], rest = 1 - at[i];
      value += 100 * bend * bend + rest * rest;
      gradient[i] = -400 * bend * at[i] - 2 * rest;
      gradient[i + 1] = 200 * bend;
    }
    return value;
  };
  const MinimiserReport report = minimise(function, {.gradient_tolerance = 1e-8}, x);
  EXPECT_TRUE(report.converged);
  EXPECT_LE(report.gradient_norm, 1e-8);
  EXPECT_GT(report.evaluations, 10);
  // Least curvature at the minimum: 0.4.
  EXPECT_LE((x.array() - 1).matrix().norm(), 1e-7);
}

TEST(Minimiser, SaysThatItDidNotConvergeAndThrowsOnWhatTheFunctionThrows) {
  Eigen::VectorXd x = Eigen::VectorXd::Constant(2, 3);
  const auto quartic = [](const Eigen::VectorXd& at, Eigen::VectorXd& gradient) {
    gradient = 4 * at.array().cube().matrix();
    return at.array().square().square().sum();
  };
  EXPECT_FALSE(minimise(quartic, {.gradient_tolerance = 1e-12, .max_iterations = 2}, x).converged);
  const auto failing = [](const Eigen::VectorXd&, Eigen::VectorXd&) -> double { throw WorkError("no value"); };
  EXPECT_THROW(minimise(failing, {.gradient_tolerance = 1e-8}, x), WorkError);
}

class SurfaceEnergyTest : public testing::Test {
 protected:
  static double at(const SurfaceEnergy& energy, const SurfaceEnergy::Shape& shape, const VertexArray& x) {
    VertexArray gradient;
    return energy.evaluate(SurfaceEnergy::blend({shape}, Eigen::VectorXd::Ones(1)), x, gradient);
  }
  SurfaceEnergy only(double stretching, double bending, double volume) const {
    return SurfaceEnergy(surface_, {stretching, bending, volume});
  }

  TetMesh box_ = test::box_mesh({1, 1, 1}, {2, 1, 3});  // all vertices on its surface
  TriangleArray surface_ = surface_triangles(box_.tets);
};

TEST_F(SurfaceEnergyTest, GradientIsTheDerivativeOfTheBlend) {
  const SurfaceEnergy energy(surface_, {});
  EXPECT_EQ(energy.edge_count(), 18);  // twelve edges and six diagonals
  std::vector<SurfaceEnergy::Shape> shapes;
  for (const std::uint32_t seed : {1U, 2U, 3U})
    shapes.push_back(energy.shape(box_.vertices + 0.2 * test::random_matrix(8, 3, seed)));
  const Eigen::Vector3d weights(0.5, 0.2, 0.3);
  const SurfaceEnergy::Blend blend = SurfaceEnergy::blend(shapes, weights);
  const VertexArray x = box_.vertices + 0.2 * test::random_matrix(8, 3, 4), direction = test::random_matrix(8, 3, 5);
  VertexArray gradient, unused;
  const double value = energy.evaluate(blend, x, gradient);
  double sum = 0;
  for (std::size_t k = 0; k < shapes.size(); ++k) sum += weights[static_cast<int>(k)] * at(energy, shapes[k], x);
  EXPECT_NEAR(value, sum, 1e-12 * sum);
  constexpr double kStep = 1e-6;  // central: 1e-12 of the third derivative, 1e-10 of rounding
  const double difference =
      (energy.evaluate(blend, x + kStep * direction, unused) - energy.evaluate(blend, x - kStep * direction, unused)) /
      (2 * kStep);
  EXPECT_NEAR(gradient.cwiseProduct(direction).sum(), difference, 1e-8 * gradient.norm() * direction.norm());
}

// Scaled by s: every length is off by s - 1, no angle is, the volume by s^3 - 1.
TEST_F(SurfaceEnergyTest, TermsAreThoseOfTheirDefinitionsForAScaledBody) {
  constexpr double kScale = 1.1;
  const VertexArray scaled = kScale * box_.vertices;
  const SurfaceEnergy stretching = only(2, 0, 0), bending = only(0, 1, 0), volume = only(0, 0, 3);
  EXPECT_NEAR(at(stretching, stretching.shape(box_.vertices), scaled), 2 * 18 * 0.01, 1e-12);
  EXPECT_NEAR(at(bending, bending.shape(box_.vertices), scaled), 0, 1e-12);
  EXPECT_NEAR(at(volume, volume.shape(box_.vertices), scaled), 3 * std::pow(std::pow(kScale, 3) - 1, 2), 1e-12);
  EXPECT_NEAR(volume.shape(box_.vertices).volume, 6, 1e-12);
}

TEST_F(SurfaceEnergyTest, AnglesOfABoxAreRightAnglesAndFlatDiagonals) {
  const SurfaceEnergy::Shape shape = only(1, 1, 1).shape(box_.vertices);
  int edges = 0;
  for (const double angle : shape.angles) {
    if (std::abs(std::abs(angle) - std::numbers::pi / 2) < 1e-12)
      ++edges;
    else
      EXPECT_NEAR(angle, 0, 1e-12);
  }
  EXPECT_EQ(edges, 12);
}

TEST_F(SurfaceEnergyTest, MovingTheBodyCostsNothing) {
  const SurfaceEnergy energy(surface_, {});
  const Eigen::Matrix3d R = Eigen::AngleAxisd(2, Eigen::Vector3d(1, 2, -1).normalized()).toRotationMatrix();
  const VertexArray moved = (box_.vertices * R.transpose()).rowwise() + Eigen::RowVector3d(4, -5, 6);
  EXPECT_NEAR(at(energy, energy.shape(box_.vertices), moved), 0, 1e-12 * 1000);
}

TEST_F(SurfaceEnergyTest, RefusesAnOpenSurface) {
  EXPECT_THROW(SurfaceEnergy(surface_.topRows(surface_.rows() - 1), {}), InputError);
}

struct Baseline {
  explicit Baseline(bool free = false, MaterialModel material = MaterialModel::kStVenantKirchhoff)
      : bar(test::make_bar({.cells = {4, 2, 2}, .material = material, .free = free, .examples = 3})),
        model(build_sparse_model(bar.model, {.whole_body = true})) {
    use_surface_targets(*bar.model.object, model);
  }

  test::Bar bar;
  SparseModel model;
};

TEST(SurfaceTargets, GradientIsTheDerivative) {
  const Baseline baseline;
  const auto& targets = dynamic_cast<const SurfaceTargets&>(*baseline.model.target_methods.front());
  const Eigen::Vector3d weights(0.3, 0.5, 0.2);
  const Eigen::VectorXd z = 0.5 * (targets.pose(1) + targets.pose(2)), direction = test::random_vector(z.size(), 1);
  Eigen::VectorXd gradient, unused;
  targets.energy(weights, z, gradient);
  const double step = 1e-6 * z.norm();
  const double difference =
      (targets.energy(weights, z + step * direction, unused) - targets.energy(weights, z - step * direction, unused)) /
      (2 * step);
  EXPECT_NEAR(gradient.dot(direction), difference, 1e-7 * gradient.norm() * direction.norm());
}

// And between two examples the minimum is below what blending their descriptors gives.
TEST(SurfaceTargets, OfOneExampleAloneIsThatExample) {
  const Baseline baseline;
  const auto& targets = dynamic_cast<const SurfaceTargets&>(*baseline.model.target_methods.front());
  for (Eigen::Index k = 0; k < 3; ++k) {
    Eigen::VectorXd z = 0.5 * targets.pose(1) + 0.3 * targets.pose(2);
    const TargetMethod::Solved report = targets.solve(Eigen::Vector3d::Unit(k), z);
    EXPECT_TRUE(report.converged) << k;
    // A gradient of 1e-6 of the examples' own.
    EXPECT_LE((z - targets.pose(k)).norm(), 1e-4 * targets.pose(2).norm()) << k;
  }
  const Eigen::Vector3d half(0, 0.5, 0.5);
  Eigen::VectorXd z = 0.5 * (targets.pose(1) + targets.pose(2)), unused;
  const double blended = targets.energy(half, z, unused);
  EXPECT_TRUE(targets.solve(half, z).converged);
  EXPECT_LT(targets.energy(half, z, unused), 0.99 * blended);
}

// A body without loads goes over to an example that the bias asks for, whatever the rest pose resists: with an example
// elasticity much above the material's own, nearly there.
TEST(Baseline, ABodyTakesTheShapeOfTheTarget) {
  for (const bool free : {false, true}) {
    const Baseline baseline(free);
    FullSpaceScene scene;
    scene.time_step = 0.01;
    scene.integrator = Integrator::kBackwardEuler;
    scene.mass_damping = 5;
    scene.examples = {{.stiffness = 50, .bias = 0, .elastic = true}};
    FullSpaceState state = at_rest(baseline.model);
    SparseWorkspace workspace(baseline.model);
    SparseReport report;
    for (int i = 0; i < 150; ++i) {
      report = step(baseline.model, scene, state, workspace);
      ASSERT_FALSE(report.status & runtime::kStepNonFinite) << i;
    }
    const Eigen::VectorXd target = baseline.model.examples.front().pose_basis() * state.examples.front().target;
    const Eigen::VectorXd u = Deformation(baseline.model, state.q).u();
    EXPECT_LE((u - target).norm(), 0.1 * target.norm()) << free;
    EXPECT_GE(target.lpNorm<Eigen::Infinity>(), 0.02 * baseline.bar.length) << "the target is no pose";
    EXPECT_GT(report.target_seconds, 0);
    EXPECT_GT(report.seconds, report.target_seconds);
  }
}

// At rest the force is that of the energy's slope: the acceleration of the first step of Newmark's method.
TEST(Baseline, StartsWithTheForceOfTheElasticEnergy) {
  const Baseline baseline;
  FullSpaceScene scene;
  scene.time_step = 1e-5;
  scene.integrator = Integrator::kNewmark;
  scene.examples = {{.stiffness = 0.3, .bias = 0.5, .elastic = true}};
  FullSpaceState state = at_rest(baseline.model);
  run(baseline.model, scene, state, 1);
  MeshElasticity elasticity = baseline.model.elasticity;
  const Eigen::VectorXd target = baseline.model.examples.front().pose_basis() * state.examples.front().target;
  const VertexArray shape = baseline.model.rest + baseline.model.system.extend(target).reshaped<Eigen::RowMajor>(
                                                      baseline.model.rest.rows(), 3);
  ASSERT_EQ(elasticity.set_undeformed(shape), 0);
  Eigen::VectorXd force;
  elasticity.force(-target, force);
  // The error is of first order in the step, over which the stiffest vibrations move on.
  EXPECT_LE((baseline.model.system.mass * state.a + 0.3 * force).norm(), 1e-3 * 0.3 * force.norm());
}

}  // namespace
}  // namespace exmat::precompute
