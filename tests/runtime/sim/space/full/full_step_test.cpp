#include "runtime/sim/space/full/full_step.h"

#include <cmath>
#include <gtest/gtest.h>
#include <numbers>
#include <omp.h>
#include <string>

#include "common/core/decompositions.h"
#include "common/mesh/assembly.h"
#include "tests/runtime/sim/space/full/full_bar.h"
#include "tests/support/allocation_counter.h"

namespace exmat::runtime {
namespace {

/// Steps for a time; every one has to converge.
State run(const FullModel& model, const StepScene& scene, State state, double time, const FullAccuracy& accuracy = {}) {
  FullWorkspace workspace(model, scene, accuracy);
  const auto steps = static_cast<int>(std::lround(time / scene.time_step));
  for (int i = 0; i < steps; ++i) EXPECT_EQ(step(model, scene, state, workspace).status, 0U) << "step " << i;
  return state;
}

State at_rest(const FullModel& model, const StepScene& scene) {
  FullWorkspace workspace(model, scene);
  return make_state(model, workspace);
}

/// Displacement in the first mode of bending, of so many metres at the end, and its angular frequency.
struct Mode {
  Eigen::VectorXd shape;
  double angular_frequency = 0;
};
Mode first_mode(const FullBar& bar, double size) {
  std::vector<std::int32_t> free;
  for (Eigen::Index v = 0; v < bar.mesh.vertex_count(); ++v)
    for (int c = 0; c < 3 && bar.fixed[v] == 0; ++c) free.push_back(static_cast<std::int32_t>(3 * v + c));
  const Eigen::MatrixXd K = submatrix(elastic_stiffness(bar.mesh, bar.materials), free);
  const Eigen::MatrixXd M = submatrix(expand_to_vectors(scalar_mass(bar.mesh, bar.materials.density)), free);
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> solver(K, M);
  const Eigen::VectorXd shape = solver.eigenvectors().col(0);
  return {size / shape.cwiseAbs().maxCoeff() * shape, std::sqrt(solver.eigenvalues()[0])};
}

// A load that comes and goes smoothly, so that nothing fast moves, bends the bar by a third of its length. Halving the
// step has to divide the error by 4 and by 2.
TEST(FullStepTest, ConvergesInTheOrderOfItsIntegrator) {
  for (const Integrator integrator : {Integrator::kBdf2, Integrator::kBackwardEuler}) {
    const FullBar bar({.cells = {4, 1, 1}});
    const double period = 2 * std::numbers::pi / first_mode(bar, 1).angular_frequency;
    const Eigen::VectorXd force = bar.end_force({0, 1.5, 3});
    const auto end = [&](int steps) {
      StepScene scene = full_scene(1.5 * period / steps);
      scene.integrator = integrator;
      FullWorkspace workspace(bar.model, scene);
      State state = make_state(bar.model, workspace);
      for (int i = 1; i <= steps; ++i) {
        state.applied_force = force * (1 - std::cos(2 * std::numbers::pi * i / steps));
        EXPECT_EQ(step(bar.model, scene, state, workspace).status, 0U);
      }
      return state.q;
    };
    const bool second = integrator == Integrator::kBdf2;
    const int steps = second ? 160 : 640;
    const Eigen::VectorXd coarse = end(steps), middle = end(2 * steps), fine = end(4 * steps);
    EXPECT_GE(fine.cwiseAbs().maxCoeff(), 0.02);
    EXPECT_NEAR((coarse - middle).norm() / (middle - fine).norm(), second ? 4 : 2, second ? 0.2 : 0.1);
  }
}

// BDF2 is slow by (omega h)^2 / 3 = 8e-5 of the frequency at 400 steps a period, and an amplitude of 1e-6 m is linear.
TEST(FullStepTest, SwingsAtTheFrequencyOfTheEigenproblem) {
  for (const Formulation formulation : kFormulations) {
    const FullBar bar({.formulation = formulation, .two_parts = true});
    const Mode mode = first_mode(bar, 1e-6);
    StepScene scene = full_scene(2 * std::numbers::pi / mode.angular_frequency / 400);
    FullWorkspace workspace(bar.model, scene);
    State state = make_state(bar.model, mode.shape, Eigen::VectorXd::Zero(bar.space.size()), workspace);
    std::vector<double> crossings;
    for (int i = 0; i < 1200; ++i) {
      const double before = state.q.dot(mode.shape);
      ASSERT_EQ(step(bar.model, scene, state, workspace).status, 0U);
      const double after = state.q.dot(mode.shape);
      if (before > 0 && after <= 0) crossings.push_back(state.time - scene.time_step * after / (after - before));
    }
    ASSERT_EQ(crossings.size(), 3U);
    const double found = 2 * std::numbers::pi * 2 / (crossings[2] - crossings[0]);
    EXPECT_NEAR(found / mode.angular_frequency, 1 - 8.2e-5, 2e-5);
  }
}

StepScene loaded(const FullBar& bar, double time_step, double tolerance = 1e-9) {
  StepScene scene = full_scene(time_step, tolerance);
  scene.gravity = {0, 0, -3};
  scene.mass_damping = 0.5;
  scene.stiffness_damping = 0.01;
  scene.forces.push_back({.start = 0.1, .end = 0.3, .on_vertices = bar.end_force({0, 1.5, 1})});
  return scene;
}

// The gradient is in double precision: the tolerance is met whatever the precision of the directions.
// A vertex at 1e7 m is known to 2e-9 m, a strain of 1e-8 in an edge beside one of 1e-2.
TEST(FullStepTest, IsTheSameFarFromTheOrigin) {
  const FullBar bar({.free = true});
  const StepScene scene = full_scene(0.004, 1e-6);
  const Eigen::VectorXd u = 0.01 * test::random_vector(bar.space.size(), 3);
  double elastic[2];
  for (const bool far : {false, true}) {
    FullWorkspace workspace(bar.model, scene);
    Eigen::VectorXd q = u;
    for (Eigen::Index i = 0; far && i < q.size(); i += 3) q[i + 1] += 1e7;
    State state = make_state(bar.model, q, Eigen::VectorXd::Zero(q.size()), workspace);
    for (int i = 0; i < 10; ++i) {
      ASSERT_EQ(step(bar.model, scene, state, workspace).status, 0U) << far << i;
    }
    elastic[far ? 1 : 0] = energies(bar.model, scene, state, workspace).elastic;
  }
  EXPECT_GT(elastic[0], 0);
  EXPECT_NEAR(elastic[1], elastic[0], 1e-4 * elastic[0]);
}

TEST(FullStepTest, MeetsATightTolerance) {
  for (const MaterialModel model : kModels)
    for (const Formulation formulation : kFormulations) {
      const FullBar bar({.model = model, .formulation = formulation, .two_parts = true});
      const StepScene scene = loaded(bar, 0.004, 1e-10);
      const State state = run(bar.model, scene, at_rest(bar.model, scene), 0.4);
      EXPECT_GE(state.q.cwiseAbs().maxCoeff(), 0.05);
    }
}

// In equilibrium steps of any length leave the body where it is.
TEST(FullStepTest, SagDoesNotDependOnTheStep) {
  for (const double poisson_ratio : {0.3, 0.49}) {
    const FullBar bar({.poisson_ratio = poisson_ratio});
    Eigen::VectorXd sag;
    for (const double time_step : {1.0 / 30, 0.004}) {
      StepScene scene = full_scene(time_step);
      scene.gravity = {0, 0, -3};
      scene.mass_damping = 4;
      const State state = run(bar.model, scene, at_rest(bar.model, scene), 8);
      if (sag.size() == 0) sag = state.q;
      EXPECT_LE((state.q - sag).norm(), 1e-6 * sag.norm());
    }
    StepScene fine = full_scene(1e-4);
    fine.gravity = {0, 0, -3};
    State state = at_rest(bar.model, fine);
    state.q = state.q_previous = sag;
    state = run(bar.model, fine, state, 0.02);
    EXPECT_LE((state.q - sag).norm(), 1e-6 * sag.norm());
  }
}

// Integrators that damp what they cannot resolve never add energy, whatever the length of the step.
TEST(FullStepTest, UndampedMotionStaysBounded) {
  for (const double time_step : {0.004, 1.0 / 60})
    for (const bool real_time : {false, true}) {
      const FullBar bar({.cells = {4, 1, 1}});
      StepScene scene = full_scene(time_step, 1e-6);
      if (real_time) scene.space.newton = SpaceSettings{}.newton;
      FullWorkspace workspace(bar.model, scene, real_time ? kRealTime : FullAccuracy{});
      State state = at_rest(bar.model, scene);
      state.v = state.v_previous = 2 * first_mode(bar, 1).shape;
      const double before = energies(bar.model, scene, state, workspace).total();
      const auto steps = static_cast<int>(20 / time_step);
      double largest = 0;
      for (int i = 0; i < steps; ++i) {
        ASSERT_EQ(step(bar.model, scene, state, workspace).status & kStepNonFinite, 0U);
        if (i % 10 == 0) largest = std::max(largest, energies(bar.model, scene, state, workspace).total());
      }
      EXPECT_LE(largest, 1.01 * before) << time_step << " " << real_time;
    }
}

// The load bends the bar by about a fifth of its length; a hundred times as much turns elements inside out.
TEST(FullStepTest, ComesBackFromAHundredTimesTheLoad) {
  for (const MaterialModel model : {MaterialModel::kStableNeoHookean, MaterialModel::kCorotational})
    for (const bool real_time : {false, true}) {
      const FullBar bar({.model = model});
      StepScene scene = full_scene(0.004, 1e-6);
      if (real_time) scene.space.newton = SpaceSettings{}.newton;
      scene.mass_damping = 4;
      scene.stiffness_damping = 0.01;
      scene.forces.push_back({.start = 0.1, .end = 0.2, .on_vertices = bar.end_force({-100, 100, 50})});
      FullWorkspace workspace(bar.model, scene, real_time ? kRealTime : FullAccuracy{});
      State state = make_state(bar.model, workspace);
      double largest = 0;
      for (int i = 0; i < 1500; ++i) {
        ASSERT_EQ(step(bar.model, scene, state, workspace).status & kStepNonFinite, 0U);
        largest = std::max(largest, state.q.cwiseAbs().maxCoeff());
      }
      EXPECT_GE(largest, 0.9);
      EXPECT_LE(state.q.cwiseAbs().maxCoeff(), 1e-3);
    }
}

// From a shape of inverted elements, in steps so long that the tangents are not positive definite.
TEST(FullStepTest, RecoversFromRandomAndMirroredShapes) {
  for (const MaterialModel model : {MaterialModel::kStableNeoHookean, MaterialModel::kCorotational})
    for (const bool mirrored : {false, true}) {
      const FullBar bar({.model = model});
      StepScene scene = full_scene(1.0 / 30, 1e-6);
      scene.mass_damping = 4;
      FullWorkspace workspace(bar.model, scene);
      Eigen::VectorXd u = 0.3 * test::random_vector(bar.space.size(), 9);
      for (Eigen::Index v = 0, row = 0; mirrored && v < bar.mesh.vertex_count(); ++v) {
        if (bar.fixed[v] != 0) continue;
        u.segment<3>(row) = Eigen::Vector3d(-2 * bar.mesh.vertices(v, 0), 0, 0);
        row += 3;
      }
      State state = make_state(bar.model, u, Eigen::VectorXd::Zero(u.size()), workspace);
      int projections = 0;
      for (int i = 0; i < 300; ++i) {
        const FullReport report = step(bar.model, scene, state, workspace);
        ASSERT_EQ(report.status & kStepNonFinite, 0U);
        projections += report.projections;
      }
      EXPECT_GT(projections, 0);
      EXPECT_LE(state.q.cwiseAbs().maxCoeff(), 1e-3) << static_cast<int>(model) << " " << mirrored;
    }
}

// Few iterations are enough for half a percent of the displacement; that is far more than rounding.
TEST(FullStepTest, RealTimeAccuracyIsWithinHalfAPercent) {
  for (const MaterialModel model : kModels) {
    const FullBar bar({.model = model});
    const StepScene tight = loaded(bar, 0.004);
    StepScene quick = tight;
    quick.newton = SpaceSettings{}.newton;
    FullWorkspace tight_workspace(bar.model, tight), quick_workspace(bar.model, quick, kRealTime);
    State expected = at_rest(bar.model, tight), state = expected;
    double error = 0, size = 0;
    int iterations = 0;
    for (int i = 0; i < 150; ++i) {
      ASSERT_EQ(step(bar.model, tight, expected, tight_workspace).status, 0U);
      const FullReport report = step(bar.model, quick, state, quick_workspace);
      ASSERT_EQ(report.status, 0U);
      iterations += report.cg_iterations;
      error = std::max(error, (state.q - expected.q).norm());
      size = std::max(size, expected.q.norm());
    }
    EXPECT_LE(error, 0.005 * size);
    EXPECT_LE(iterations, 4 * 150);
  }
}

// The body comes to rest where all forces balance, though a residual of a percent of the forces would do for a step:
// it would tremble by 1e-6 of its sag.
TEST(FullStepTest, RealTimeAccuracySettlesInTheEquilibrium) {
  const FullBar bar;
  StepScene scene = full_scene(0.004);
  scene.gravity = {0, 0, -3};
  scene.mass_damping = 4;
  const State expected = run(bar.model, scene, at_rest(bar.model, scene), 8);
  scene.space.newton = SpaceSettings{}.newton;
  State state = run(bar.model, scene, at_rest(bar.model, scene), 16, kRealTime);
  EXPECT_LE((state.q - expected.q).norm(), 1e-6 * expected.q.norm());
  EXPECT_LE(scene.time_step * state.v.norm(), 1e-9 * expected.q.norm());
}

// A linear example force pulls towards its target; with much stiffness the body is there as far as the filter sees.
TEST(FullStepTest, ExampleForcePullsTowardsItsTarget) {
  const FullBar bar({.functions = 3});
  StepScene scene = full_scene(0.004);
  scene.mass_damping = 20;
  scene.examples.push_back({.stiffness = 1e6, .damping = 1});
  FullWorkspace workspace(bar.model, scene);
  State state = make_state(bar.model, workspace);
  const Eigen::MatrixXd target = 0.1 * test::random_matrix(3, 3, 8);
  const Eigen::VectorXd by_function = target.reshaped<Eigen::RowMajor>();
  for (int i = 0; i < 500; ++i) {
    FullStep one(bar.model, scene, state, workspace);
    one.begin();
    one.set_target(0, by_function);
    one.solve();
    ASSERT_EQ(one.finish().status, 0U);
  }
  Eigen::VectorXd coefficients(bar.space.coefficients());
  kernels().mesh_coefficients(bar.space.filter(), bar.space.to_field(state.q).data(), coefficients.data());
  const Eigen::MatrixXd found = coefficients.reshaped(4, bar.space.coefficients() / 4).topLeftCorner(3, 3).transpose();
  EXPECT_LE((found - target).norm(), 0.01 * target.norm());
}

TEST(FullStepTest, FreeBodyWithoutDampingKeepsItsMomenta) {
  const FullBar bar({.free = true});
  const StepScene scene = full_scene(0.004, 1e-10);
  State state = at_rest(bar.model, scene);
  const Eigen::VectorXd kick = test::random_vector(bar.space.size(), 3);
  const SparseMatrix mass = expand_to_vectors(scalar_mass(bar.mesh, bar.materials.density));
  state.v = state.v_previous = kick;
  const auto momentum = [&] {
    return Eigen::Vector3d((mass * state.v).reshaped(3, state.v.size() / 3).rowwise().sum());
  };
  const Eigen::Vector3d before = momentum();
  state = run(bar.model, scene, state, 0.4);
  EXPECT_LE((momentum() - before).norm(), 1e-9 * (mass * kick).norm());
}

// Workspaces must not matter: only the state goes on.
TEST(FullStepTest, SameBitsFromACopyOfTheStateAndWithAnyNumberOfThreads) {
  for (const bool real_time : {false, true}) {
    const FullBar bar;
    StepScene scene = loaded(bar, 0.004, 1e-6);
    if (real_time) scene.space.newton = SpaceSettings{}.newton;
    const FullAccuracy accuracy = real_time ? kRealTime : FullAccuracy{};
    FullWorkspace workspace(bar.model, scene, accuracy);
    State whole = make_state(bar.model, workspace);
    State part = whole;
    const int threads = omp_get_max_threads();
    omp_set_num_threads(1);
    for (int i = 0; i < 60; ++i) step(bar.model, scene, whole, workspace);
    omp_set_num_threads(4);
    for (int i = 0; i < 60; ++i) {
      FullWorkspace fresh(bar.model, scene, accuracy);
      step(bar.model, scene, part, fresh);
    }
    omp_set_num_threads(threads);
    EXPECT_EQ(whole.q, part.q);
    EXPECT_EQ(whole.v, part.v);
    EXPECT_EQ(whole.elastic_energy, part.elastic_energy);
  }
}

TEST(FullStepTest, NoStepAllocates) {
  if (!test::AllocationCounter::works()) GTEST_SKIP() << "a sanitizer owns malloc";
  const FullBar bar({.functions = 5});
  for (const bool real_time : {false, true}) {
    StepScene scene = loaded(bar, 1.0 / 30);
    scene.examples.push_back({.stiffness = 100, .damping = 1});
    if (real_time) scene.space.newton = SpaceSettings{}.newton;
    FullWorkspace workspace(bar.model, scene, real_time ? kRealTime : FullAccuracy{});
    const Eigen::VectorXd u = 0.3 * test::random_vector(bar.space.size(), 9);  // projections and line searches too
    State state = make_state(bar.model, u, 0 * u, workspace);
    int projections = 0;
    const test::AllocationCounter counter;
    for (int i = 0; i < 100; ++i) projections += step(bar.model, scene, state, workspace).projections;
    EXPECT_EQ(counter.count(), 0U);
    EXPECT_GT(projections, 0);
  }
}

TEST(FullStepTest, StateStaysWhereANumberIsNotFinite) {
  const FullBar bar;
  const StepScene scene = full_scene(0.004);
  FullWorkspace workspace(bar.model, scene);
  State state = make_state(bar.model, workspace);
  state.applied_force[4] = std::nan("");
  EXPECT_EQ(step(bar.model, scene, state, workspace).status, kStepNonFinite);
  EXPECT_EQ(state.step, 0);
  EXPECT_TRUE(state.q.isZero(0));
}

// Waves go 40 edges of it in a step. Held by four iterations a step and without a look at where they led, such a body
// took up 1e6 J from steps without damping; it falls by 1e-4 m here, and 0.03 J are all that is about.
TEST(FullStepTest, AStiffBodyTakesNoEnergyFromLongSteps) {
  struct Stiff {
    double youngs_modulus, poisson_ratio, time_step;
  };
  // Waves of volume go 40 and 7 edges in a step.
  for (const auto& [youngs_modulus, poisson_ratio, time_step] : {Stiff{1e9, 0.49, 0.004}, Stiff{1e6, 0.4999, 0.001}})
    for (const MaterialModel model : kModels) {
      const FullBar bar({.model = model, .youngs_modulus = youngs_modulus, .poisson_ratio = poisson_ratio});
      StepScene scene = full_scene(time_step);
      scene.space.newton = SpaceSettings{}.newton;
      scene.gravity = {0, 0, -9.81};
      FullWorkspace workspace(bar.model, scene, kRealTime);
      State state = make_state(bar.model, workspace);
      for (int i = 0; i < 400; ++i) {
        ASSERT_EQ(step(bar.model, scene, state, workspace).status & kStepNonFinite, 0U);
        if (i % 10 == 0) ASSERT_LE(energies(bar.model, scene, state, workspace).total(), 1e-3) << i;
      }
    }
}

// The mirror image of a body is at rest in St.Venant-Kirchhoff's law, with forces of rounding alone, which no search
// can lower.
TEST(FullStepTest, StepsOfAMirroredBodyAtRestAreSolved) {
  const FullBar bar({.model = MaterialModel::kStVenantKirchhoff, .formulation = Formulation::kLinear, .free = true});
  StepScene scene = full_scene(1.0 / 30);
  scene.space.newton = SpaceSettings{}.newton;
  FullWorkspace workspace(bar.model, scene, kRealTime);
  Eigen::VectorXd u(bar.space.size());
  for (Eigen::Index v = 0; v < bar.mesh.vertex_count(); ++v)
    u.segment<3>(3 * bar.space.number(v)) = Eigen::Vector3d(1 - 2 * bar.mesh.vertices(v, 0), 0, 0);
  State state = make_state(bar.model, u, Eigen::VectorXd::Zero(u.size()), workspace);
  for (int i = 0; i < 40; ++i) ASSERT_EQ(step(bar.model, scene, state, workspace).status, 0U) << i;
  EXPECT_LE((state.q - u).cwiseAbs().maxCoeff(), 1e-9);
}

// Against dense matrices; factors are in single precision.
TEST(FullPreconditionerTest, DiagonalOfTheInverseAndComplianceAreThoseOfTheMatrix) {
  for (const int functions : {0, 3}) {
    const FullBar bar({.functions = functions});
    const double mass = 9e4, stiffness = 1.4, filter = functions > 0 ? 500 : 0;
    const FullPreconditioner preconditioner(bar.space, mass, stiffness, Eigen::VectorXd::Constant(functions, filter),
                                            true);
    Eigen::MatrixXd S = mass * Eigen::MatrixXd(bar.space.mass()) + stiffness * bar.space.preconditioning_stiffness();
    const Eigen::MatrixXd& W = bar.space.function_values();
    if (functions > 0) S += filter * W * W.transpose();
    const Eigen::MatrixXd inverse = S.inverse();
    EXPECT_LE((preconditioner.inverse_diagonal() - inverse.diagonal()).norm(), 1e-9 * inverse.diagonal().norm());

    StepScene scene = full_scene(1 / 300.0);
    scene.integrator = Integrator::kBackwardEuler;
    FullWorkspace workspace(bar.model, scene);
    const Eigen::MatrixXd step =
        (mass * Eigen::MatrixXd(bar.space.mass()) + Eigen::MatrixXd(bar.space.preconditioning_stiffness())).inverse();
    const std::int32_t first = 40, second = 50;
    const Eigen::Index a = bar.space.place(first), b = bar.space.place(second);
    const double expected = 0.09 * step(a, a) + 0.49 * step(b, b) + 2 * 0.21 * step(a, b);
    EXPECT_NEAR(compliance(bar.model, std::array{first, second}, std::array{0.3, 0.7}, workspace), expected,
                1e-5 * expected);
  }
}

TEST(FullStepTest, SaysWhatItCannotStep) {
  const FullBar bar, free({.free = true});
  StepScene scene = full_scene(0.004);
  EXPECT_EQ(unsupported(bar.model, scene), nullptr);
  EXPECT_EQ(unsupported(free.model, scene), nullptr);
  scene.mass_damping = 1;
  EXPECT_EQ(unsupported(bar.model, scene), nullptr);
  EXPECT_NE(unsupported(free.model, scene), nullptr);
  StepScene newmark = scene;
  newmark.integrator = Integrator::kNewmark;
  EXPECT_EQ(unsupported(bar.model, newmark), nullptr);
  StepScene examples = scene;
  examples.examples.push_back({.stiffness = 1});
  EXPECT_NE(unsupported(bar.model, examples), nullptr);
  const FullBar filtered({.functions = 2});
  EXPECT_EQ(unsupported(filtered.model, examples), nullptr);
  examples.examples.front().elastic = true;
  EXPECT_NE(unsupported(filtered.model, examples), nullptr);
}

}  // namespace
}  // namespace exmat::runtime
