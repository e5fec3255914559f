#include "runtime/sim/examples/target.h"

#include <gtest/gtest.h>
#include <tuple>

#include "common/core/decompositions.h"
#include "runtime/sim/step/model.h"
#include "tests/support/random.h"
#include "tests/support/synthetic_model.h"

namespace exmat::runtime {
namespace {

using test::Bar;
using test::BarOptions;

TargetSolver target_of(const ReducedModel& model, EnergyReference reference = EnergyReference::kExample) {
  auto result = build_model(model, {.examples = true, .energy_reference = reference});
  EXPECT_TRUE(result.model) << to_string(result.complaint);
  return *result.model->examples.front().target;
}

Eigen::VectorXd solve(const TargetSolver& target, const Eigen::VectorXd& weights, const Eigen::VectorXd& from) {
  auto workspace = target.make_workspace();
  Eigen::VectorXd y = from;
  const NewtonReport report = target.solve(weights, workspace, y);
  EXPECT_EQ(report.status, NewtonStatus::kConverged);
  return y;
}

Eigen::VectorXd cold_solve(const TargetSolver& target, const Eigen::VectorXd& weights) {
  Eigen::VectorXd y(target.dimension());
  target.start(weights, y);
  return solve(target, weights, y);
}

/// sum_k w_k E_k(p) from its definition, F by F.
double defined_energy(const ReducedModel& model, const Eigen::VectorXd& weights, const Eigen::VectorXd& p,
                      EnergyReference reference) {
  const CubatureData& cubature = *model.cubature;
  const auto gradient = [&](const Eigen::VectorXd& pose, Eigen::Index j) {
    const Eigen::VectorXd flat = cubature.gradient.middleRows<9>(9 * j) * pose;
    return Eigen::Matrix3d(Eigen::Matrix3d::Identity() + flat.reshaped<Eigen::RowMajor>(3, 3));
  };
  double sum = 0;
  for (Eigen::Index k = 0; k < weights.size(); ++k) {
    const Eigen::VectorXd& example = model.examples->examples[k].pose;
    for (Eigen::Index j = 0; j < cubature.weights.size(); ++j) {
      const Eigen::Matrix3d example_gradient = gradient(example, j);
      const bool from_example = reference == EnergyReference::kExample;
      const Eigen::Matrix3d F =
          from_example ? Eigen::Matrix3d(gradient(p, j) * example_gradient.inverse()) : gradient(p - example, j);
      const double density =
          test::energy_density(model.object->materials.model, F, cubature.youngs_modulus[j], cubature.poisson_ratio[j]);
      const double volume = from_example ? example_gradient.determinant() : 1.0;
      sum += weights[k] * cubature.weights[j] * cubature.volumes[j] * volume * density;
    }
  }
  return sum;
}

/// Five-point differences, exact for the quartic energy but for rounding.
template <class Function>
Eigen::VectorXd difference_gradient(const Function& energy, const Eigen::VectorXd& y, double h) {
  Eigen::VectorXd gradient(y.size());
  for (Eigen::Index i = 0; i < y.size(); ++i) {
    const auto at = [&](double offset) {
      return energy(Eigen::VectorXd(y + offset * h * Eigen::VectorXd::Unit(y.size(), i)));
    };
    gradient[i] = (at(-2) - 8 * at(-1) + 8 * at(1) - at(2)) / (12 * h);
  }
  return gradient;
}

/// Newton's method on differences of the energy alone.
template <class Function>
Eigen::VectorXd independent_minimum(const Function& energy, Eigen::VectorXd y, double h) {
  for (int iteration = 0; iteration < 15; ++iteration) {
    Eigen::MatrixXd hessian(y.size(), y.size());
    for (Eigen::Index i = 0; i < y.size(); ++i) {
      const Eigen::VectorXd offset = h * Eigen::VectorXd::Unit(y.size(), i);
      hessian.col(i) =
          (difference_gradient(energy, y + offset, h) - difference_gradient(energy, y - offset, h)) / (2 * h);
    }
    y -= Eigen::VectorXd(hessian.partialPivLu().solve(difference_gradient(energy, y, h)));
  }
  return y;
}

using Case = std::tuple<MaterialModel, EnergyReference>;

class TargetTest : public ::testing::TestWithParam<Case> {
 protected:
  TargetTest()
      : bar_(test::make_bar({.material = model(), .examples = 4})), target_(target_of(bar_.model, reference())) {}

  static MaterialModel model() { return std::get<MaterialModel>(GetParam()); }
  static EnergyReference reference() { return std::get<EnergyReference>(GetParam()); }
  /// Differences of St.Venant-Kirchhoff's quartic energy are exact, others err by the fourth power of their step.
  static double difference_error() { return model() == MaterialModel::kStVenantKirchhoff ? 0 : 1e-6; }

  Eigen::VectorXd example(int k) const { return target_.example(k); }
  double largest_example() const { return std::max({example(1).norm(), example(2).norm(), example(3).norm()}); }

  Bar bar_;
  TargetSolver target_;
};

INSTANTIATE_TEST_SUITE_P(Materials, TargetTest,
                         ::testing::Combine(::testing::Values(MaterialModel::kStVenantKirchhoff,
                                                              MaterialModel::kStableNeoHookean,
                                                              MaterialModel::kCorotational),
                                            ::testing::Values(EnergyReference::kExample, EnergyReference::kRest)),
                         [](const auto& test) {
                           const bool example = std::get<EnergyReference>(test.param) == EnergyReference::kExample;
                           return std::string(name_of(std::get<MaterialModel>(test.param))) +
                                  (example ? "_example" : "_rest");
                         });

TEST_P(TargetTest, EnergyIsThatOfItsDefinitionAndForceItsDerivative) {
  const Eigen::VectorXd weights = Eigen::Vector4d(0.3, 0.4, 0.2, 0.1);
  const Eigen::VectorXd y = 0.5 * largest_example() * test::random_vector(target_.dimension(), 3).normalized();
  auto workspace = target_.make_workspace();
  const auto energy = [&](const Eigen::VectorXd& at) {
    return defined_energy(bar_.model, weights, target_.basis() * at, reference());
  };
  EXPECT_NEAR(target_.energy(weights, y, workspace), energy(y), 1e-12 * energy(y));
  Eigen::VectorXd force(y.size());
  EXPECT_EQ(target_.force(weights, y, workspace, force), target_.energy(weights, y, workspace));
  const Eigen::VectorXd expected = difference_gradient(energy, y, 0.01 * largest_example());
  EXPECT_LE((force - expected).norm(), (1e-9 + difference_error()) * expected.norm());
}

TEST_P(TargetTest, ForceVanishesAtTheSolution) {
  for (std::uint32_t seed = 0; seed < 10; ++seed) {
    Eigen::VectorXd weights = test::random_vector(4, seed).cwiseAbs();
    weights /= weights.sum();
    const Eigen::VectorXd y = cold_solve(target_, weights);
    auto workspace = target_.make_workspace();
    Eigen::VectorXd force(y.size()), part(y.size());
    target_.force(weights, y, workspace, force);
    double scale = 0;
    for (int k = 0; k < 4; ++k) {
      target_.force(weights[k] * Eigen::VectorXd::Unit(4, k), y, workspace, part);
      scale += part.norm();
    }
    EXPECT_LE(force.norm(), 1e-9 * scale);
  }
}

TEST_P(TargetTest, OneExampleAloneIsReturnedFromAnyStart) {
  for (int k = 0; k < 4; ++k)
    for (int from = 0; from < 4; ++from) {
      const Eigen::VectorXd y = solve(target_, Eigen::VectorXd::Unit(4, k), example(from));
      const std::vector<ExampleData>& examples = bar_.model.examples->examples;
      EXPECT_LE((target_.basis() * y - examples[static_cast<std::size_t>(k)].pose).norm(),
                1e-8 * examples[2].pose.norm())
          << k << " from " << from;
    }
}

TEST_P(TargetTest, FollowsTheWeightsContinuously) {
  const auto largest_step = [&](int parts) {
    double largest = 0;
    Eigen::VectorXd y = example(0);
    for (int i = 0; i <= parts; ++i) {
      const double w = static_cast<double>(i) / parts;
      const Eigen::VectorXd next = solve(target_, Eigen::Vector4d(1 - w, w, 0, 0), y);
      if (i > 0) largest = std::max(largest, (next - y).norm());
      y = next;
    }
    return largest;
  };
  const double coarse = largest_step(128), fine = largest_step(512);
  EXPECT_NEAR(coarse / fine, 4, 0.2);
  EXPECT_LE(fine, 8 * largest_example() / 512);
}

TEST_P(TargetTest, WarmStartAgreesWithTheColdOneAndIsShort) {
  const Eigen::VectorXd weights = Eigen::Vector4d(0.5, 0.3, 0.2, 0);
  const Eigen::VectorXd near = Eigen::Vector4d(0.501, 0.299, 0.2, 0);
  Eigen::VectorXd y = cold_solve(target_, weights);
  auto workspace = target_.make_workspace();
  const NewtonReport report = target_.solve(near, workspace, y);
  EXPECT_LE(report.iterations, 3);
  EXPECT_LE((y - cold_solve(target_, near)).norm(), 1e-8 * largest_example());
}

TEST_P(TargetTest, AgreesWithAnIndependentMinimiser) {
  const Bar small = test::make_bar({.cells = {3, 1, 1}, .material = model(), .eigenfunctions = 2, .examples = 3});
  const TargetSolver target = target_of(small.model, reference());
  const Eigen::VectorXd weights = Eigen::Vector3d(0.4, 0.35, 0.25);
  const RowMatrix& basis = small.model.projection->target_basis;  // the bundle's own, orthonormal one
  const auto energy = [&](const Eigen::VectorXd& z) {
    return defined_energy(small.model, weights, basis * z, reference());
  };
  Eigen::VectorXd start = Eigen::VectorXd::Zero(basis.cols());
  for (std::size_t k = 0; k < 3; ++k)
    start += weights[static_cast<Eigen::Index>(k)] * basis.transpose() * small.model.examples->examples[k].pose;
  const Eigen::VectorXd expected = basis * independent_minimum(energy, start, 1e-2 * start.norm());
  EXPECT_LE((target.basis() * cold_solve(target, weights) - expected).norm(),
            (1e-7 + difference_error()) * expected.norm());
}

TEST(TargetBuildTest, AnInvertedElementIsNamedWithItsExample) {
  Bar bar = test::make_bar({.examples = 4});
  bar.model.examples->examples[3].pose *= -20;
  const auto result = build_model(bar.model, {});
  ASSERT_FALSE(result.model);
  EXPECT_EQ(result.complaint.place, "/examples/pose3");
  EXPECT_NE(result.complaint.found.find("cubature element"), std::string::npos);
  EXPECT_TRUE(build_model(bar.model, {.examples = true, .energy_reference = EnergyReference::kRest}).model);
  EXPECT_TRUE(build_model(bar.model, {.examples = false, .energy_reference = EnergyReference::kExample}).model);
}

TEST(TargetBuildTest, AnExampleOfWeightZeroDoesNotCount) {
  const Bar bar = test::make_bar({.examples = 4});
  Bar fewer = bar;
  fewer.model.examples->examples.pop_back();
  const Eigen::VectorXd y = cold_solve(target_of(bar.model), Eigen::Vector4d(0.5, 0.2, 0.3, 0));
  EXPECT_LE((y - cold_solve(target_of(fewer.model), Eigen::Vector3d(0.5, 0.2, 0.3))).norm(), 1e-8 * y.norm());
}

}  // namespace
}  // namespace exmat::runtime
