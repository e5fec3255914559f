#include "runtime/sim/space/full/full_potential.h"

#include <gtest/gtest.h>

#include "common/core/decompositions.h"
#include "common/elastic/materials.h"
#include "common/mesh/assembly.h"
#include "tests/runtime/sim/space/full/full_bar.h"
#include "tests/support/instruction_sets.h"

namespace exmat::runtime {
namespace {

constexpr double kCell = 1.0 / 6;

/// The potential of a step from a random state, damped and with an example force.
struct Potential {
  FullBar bar;
  StepScene scene = full_scene(0.004);
  StepForm form;
  FullPotentialWorkspace workspace;
  FullPotential potential;
  Eigen::VectorXd d, direction;  ///< fields

  Potential(const FullBarOptions& options, double size)
      : bar(options), workspace(bar.model), potential(bar.model, scene, form, workspace) {
    const Eigen::Index f = bar.space.size();
    form = {300, 9e4, 0.9 * size * test::random_vector(f, 1), 0.8 * size * test::random_vector(f, 2)};
    scene.mass_damping = 0.5;
    scene.stiffness_damping = 0.01;
    if (options.functions > 0) scene.examples.push_back({.stiffness = 500, .damping = 3});
    for (Eigen::Index i = 0; i < options.functions; ++i) workspace.target[i] = 0.1;
    potential.begin(size * test::random_vector(f, 3), test::random_vector(f, 4));
    d = bar.space.to_field(0.1 * size * test::random_vector(f, 6));
    direction = bar.space.to_field(test::random_vector(f, 7));
    potential.evaluate_elements(d, FullPotential::Tangents::kExact, true);
  }

  /// The example force becomes an elastic one, from a target that turns elements inside out where it is large.
  void pull_elastically(double size, double factor = 2) {
    if (bar.model.examples.empty()) bar.model.examples.emplace_back();
    workspace.elastic_target = bar.space.make_target(1);
    scene.examples = {{.stiffness = factor, .damping = 3, .elastic = true}};
    const Eigen::VectorXd target = bar.space.to_field(size * test::random_vector(bar.space.size(), 8));
    potential.set_elastic_target(0, target);
    if (factor > 1e3) d = target;  // of a body that was at rest
    potential.evaluate_elements(d, FullPotential::Tangents::kExact, false);
  }

  Eigen::VectorXd gradient(const Eigen::VectorXd& at) {
    Eigen::VectorXd gradient(at.size());
    potential.evaluate(at, gradient);
    return gradient;
  }

  Eigen::VectorXd product(const Eigen::VectorXd& x, bool with_matrices = true) {
    const double mass = form.acceleration_factor + scene.mass_damping * form.velocity_factor;
    const double stiffness = 1 + scene.stiffness_damping * form.velocity_factor;
    std::vector<float> matrix;
    for (Eigen::Index k = 0; k < bar.space.entries(); ++k)
      matrix.push_back(static_cast<float>((with_matrices ? mass * bar.space.mass_value(k) : 0) +
                                          stiffness * bar.space.variance_value(k)));
    const Eigen::VectorXf rounded = x.cast<float>();
    Eigen::VectorXf image(x.size());
    AlignedFloats lines(bar.space.padded_elements() * kMeshLine);
    kernels().mesh_product(bar.space.arrays(), matrix.data(), workspace.tangents.data(), rounded.data(), lines.data(),
                           image.data());
    if (with_matrices && !scene.examples.empty()) {
      AlignedFloats coefficients(bar.space.coefficients());
      const auto stiffness_of_filter =
          static_cast<float>(linear_stiffness(scene.examples.front()) + 3 * form.velocity_factor);
      kernels().mesh_rounded_coefficients(bar.space.rounded_filter(), rounded.data(), coefficients.data());
      kernels().mesh_add_rounded_functions(bar.space.rounded_filter(), stiffness_of_filter, coefficients.data(),
                                           image.data());
    }
    return image.cast<double>();
  }
};

template <typename Test>
void for_all_bars(Test test) {
  for (const MaterialModel model : kModels)
    for (const Formulation formulation : kFormulations)
      for (const bool two_parts : {false, true}) {
        SCOPED_TRACE(::testing::Message() << "model " << static_cast<int>(model) << ", formulation "
                                          << static_cast<int>(formulation) << ", two parts " << two_parts);
        test(FullBarOptions{.model = model, .formulation = formulation, .two_parts = two_parts, .functions = 5});
      }
}

/// Central differences over four points have errors of h^4 and of rounding / h; both are near 1e-10 of the values here.
/// The product is rounded to single precision: to 6e-8 of each term. `curved`: times as much.
void expect_derivatives(Potential& of, double curved = 1) {
  constexpr double h = 1e-5;
  const auto slope_of = [&](const auto& f) {
    using Value = decltype(f(of.d));
    const auto about = [&](double step) {
      return Value(f(of.d + step * of.direction) - f(of.d - step * of.direction));
    };
    return Value((8 * about(h) - about(2 * h)) / (12 * h));
  };
  const Eigen::VectorXd product = of.product(of.direction), gradient = of.gradient(of.d);
  const double slope = slope_of([&](const Eigen::VectorXd& d) { return of.potential.value(d).value; });
  EXPECT_NEAR(gradient.dot(of.direction), slope, curved * 1e-7 * gradient.norm() * of.direction.norm());
  const Eigen::VectorXd difference = slope_of([&](const Eigen::VectorXd& d) { return of.gradient(d); });
  EXPECT_LE((product - difference).norm(), curved * 1e-6 * difference.norm());
}

TEST(FullPotentialTest, GradientAndProductAreDerivatives) {
  for_all_bars([](const FullBarOptions& options) {
    Potential of(options, 0.1 * kCell);
    expect_derivatives(of);
    of.pull_elastically(0.1 * kCell);
    expect_derivatives(of);
    // Some elements are inside out and take no part; others are nearly flat, whose h^2 terms are a hundred times
    // larger.
    of.pull_elastically(2 * kCell);
    const AlignedArray& numbers = of.workspace.elastic_target.inverses;
    int left_out = 0;
    for (Eigen::Index e = 0; e < of.bar.space.padded_elements(); ++e)
      left_out += numbers[(e / kLanes * kInverseNumbers + 9) * kLanes + e % kLanes] == 0 ? 1 : 0;
    EXPECT_GE(left_out, 5);
    expect_derivatives(of, 100);
  });
}

TEST(FullPotentialTest, RestHasNoForceAndTheStiffnessOfLinearElasticity) {
  for_all_bars([](FullBarOptions options) {
    Potential of(options, 0);
    of.scene.stiffness_damping = 0;
    of.potential.evaluate_elements(of.d, FullPotential::Tangents::kExact, true);
    std::vector<std::int32_t> free;
    for (Eigen::Index v = 0; v < of.bar.mesh.vertex_count(); ++v)
      for (int c = 0; c < 3 && of.bar.fixed[v] == 0; ++c) free.push_back(static_cast<std::int32_t>(3 * v + c));
    const SparseMatrix K = submatrix(elastic_stiffness(of.bar.mesh, of.bar.materials), free);
    Eigen::VectorXd u(of.bar.space.size()), image(u);
    of.bar.space.from_field(of.direction, u);
    of.bar.space.from_field(of.product(of.direction, false), image);
    EXPECT_LE((image - K * u).norm(), 1e-6 * (K * u).norm());
    Eigen::VectorXd unused(of.d.size());
    of.potential.evaluate_elements(of.d, FullPotential::Tangents::kNone, false);
    EXPECT_EQ(of.potential.elastic_energy(), 0);
  });
}

double least_eigenvalue(Potential& of) {
  const Eigen::Index size = of.bar.space.field_size();
  Eigen::MatrixXd dense(size, size);
  for (Eigen::Index i = 0; i < size; ++i)
    dense.col(i) =
        i % 4 == 3 ? Eigen::VectorXd::Zero(size) : of.product(Eigen::VectorXd::Unit(size, i), /*with_matrices=*/false);
  const Eigen::VectorXd values = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(
                                     Eigen::MatrixXd(0.5 * (dense + dense.transpose())), Eigen::EigenvaluesOnly)
                                     .eigenvalues();
  return values[0] / values.tail(1)[0];
}

// Displacements of several cells turn elements inside out; single precision leaves eigenvalues of 0 at 1e-7 of the
// largest one.
TEST(FullPotentialTest, ProjectedTangentsArePositiveSemidefinite) {
  for (const MaterialModel model : kModels)
    for (const Formulation formulation : kFormulations) {
      double exact = 0;
      for (const double size : {0.1, 0.5, 2.0}) {
        Potential of({.cells = {3, 2, 2}, .model = model, .formulation = formulation}, size);
        exact = std::min(exact, least_eigenvalue(of));
        of.potential.evaluate_elements(of.d, FullPotential::Tangents::kProjected, true);
        EXPECT_GE(least_eigenvalue(of), -1e-6) << static_cast<int>(model) << " " << static_cast<int>(formulation);
        of.pull_elastically(0.1 * kCell);
        of.potential.evaluate_elements(of.d, FullPotential::Tangents::kProjected, false);
        EXPECT_GE(least_eigenvalue(of), -1e-6) << static_cast<int>(model) << " " << static_cast<int>(formulation);
      }
      EXPECT_LE(exact, -1e-3) << static_cast<int>(model) << " " << static_cast<int>(formulation);
    }
}

TEST(FullPotentialTest, ProjectionKeepsTangentsThatAreConvex) {
  for_all_bars([](const FullBarOptions& options) {
    Potential of(options, 0);
    const Eigen::VectorXd before = of.product(of.direction);
    of.potential.evaluate_elements(of.d, FullPotential::Tangents::kProjected, true);
    EXPECT_LE((of.product(of.direction) - before).norm(), 1e-6 * before.norm());
    // At the target, so stiff that the body's own part, which may be projected there, is none beside it.
    of.pull_elastically(0.1 * kCell, 1e7);
    const Eigen::VectorXd pulled = of.product(of.direction);
    of.potential.evaluate_elements(of.d, FullPotential::Tangents::kProjected, false);
    EXPECT_LE((of.product(of.direction) - pulled).norm(), 2e-6 * pulled.norm());
  });
}

// Sums of some thousand terms in other orders: 1e-13 in double, 1e-6 in single precision.
TEST(FullPotentialTest, InstructionSetsAgree) {
  for_all_bars([](const FullBarOptions& options) {
    Potential of(options, 0.1 * kCell);
    const FullSpace& space = of.bar.space;
    const StepForm& form = of.form;
    const MeshInertia terms{of.workspace.x.data(),    of.workspace.a.data(),      of.workspace.w.data(),
                            form.acceleration_factor, 0.5 * form.velocity_factor, 0.01 * form.velocity_factor};
    Eigen::VectorXd expected, expected_sums;
    Eigen::VectorXf expected_image, expected_solution;
    for (const Kernels* run : available()) {
      SCOPED_TRACE(run->name);
      Eigen::VectorXd inertia(space.field_size()), force(inertia), sums(kMeshSums);
      run->mesh_inertia(space.arrays(), terms, inertia.data(), force.data(), sums.data());
      run->mesh_force_and_tangents(space.arrays(), space.law(), nullptr, terms, true, of.workspace.frozen.data(),
                                   of.workspace.tangents.data(), of.workspace.lines.data(), force.data(), sums.data());
      const std::vector<float> none(static_cast<std::size_t>(space.entries()), 0);
      const Eigen::VectorXf x = of.direction.cast<float>();
      Eigen::VectorXf image(x.size()), solution(x.size());
      AlignedFloats lines(space.padded_elements() * kMeshLine);
      run->mesh_product(space.arrays(), none.data(), of.workspace.tangents.data(), x.data(), lines.data(),
                        image.data());
      if (expected.size() == 0) {
        expected = force;
        expected_sums = sums;
        expected_image = image;
      }
      EXPECT_LE((force - expected).norm(), 1e-13 * expected.norm());
      EXPECT_LE((sums - expected_sums).norm(), 1e-13 * expected_sums.norm());
      EXPECT_LE((image - expected_image).norm(), 1e-6F * expected_image.norm());
    }
  });
}

TEST(FullPreconditionerTest, SolvesWithTheScalarMatrixAndTheFilter) {
  const FullBar bar({.two_parts = true, .functions = 5});
  const FullSpace& space = bar.space;
  const FullPreconditioner preconditioner(space, 1e5, 3, Eigen::VectorXd::Constant(5, 700));
  const Eigen::MatrixXd& W = space.function_values();
  const Eigen::MatrixXd S =
      Eigen::MatrixXd(1e5 * space.mass() + 3 * space.preconditioning_stiffness()) + 700 * W * W.transpose();
  for (const Kernels* run : available()) {
    SCOPED_TRACE(run->name);
    AlignedFloats right(space.field_size()), x(right), coefficients(space.coefficients());
    right.vector() = space.to_field(test::random_vector(space.size(), 1)).cast<float>();
    preconditioner.solve(*run, right, x, coefficients);
    const auto columns = [](const AlignedFloats& field) {
      return Eigen::MatrixXd(field.vector().cast<double>().reshaped(4, field.size() / 4).transpose());
    };
    EXPECT_LE((S * columns(x) - columns(right)).norm(), 1e-4 * columns(right).norm());
  }
}

TEST(FullSpaceTest, FieldsHoldTheDisplacementsOfVerticesThatMove) {
  const FullBar bar;
  const Eigen::VectorXd u = test::random_vector(bar.space.size(), 1);
  Eigen::VectorXd back(u.size());
  bar.space.from_field(bar.space.to_field(u), back);
  EXPECT_EQ(u, back);
  EXPECT_EQ(bar.space.vertices(), bar.mesh.vertex_count() - bar.fixed.cast<int>().sum());
}

// Half the weight of a body whose vertices at one end are fixed acts on the others, and more: all but that of the
// fixed vertices, of a volume of a tet's quarter in each of their tets.
TEST(FullSpaceTest, GravityActsOnWhatTheVerticesCarry) {
  const FullBar bar({.two_parts = true});
  const SparseMatrix mass = scalar_mass(bar.mesh, bar.materials.density);
  const Eigen::VectorXd carried = mass * Eigen::VectorXd::Ones(mass.rows());
  Eigen::Index row = 0;
  for (Eigen::Index v = 0; v < bar.mesh.vertex_count(); ++v) {
    if (bar.fixed[v] != 0) continue;
    EXPECT_LE((bar.space.gravity_load().middleRows<3>(row) - carried[v] * Eigen::Matrix3d::Identity()).norm(),
              1e-12 * carried[v]);
    row += 3;
  }
}

}  // namespace
}  // namespace exmat::runtime
