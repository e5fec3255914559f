#include "runtime/sim/solver/newton.h"

#include <cmath>
#include <gtest/gtest.h>

namespace exmat::runtime {
namespace {

/// A function of one unknown with its derivatives; what Newton's method asks of a problem.
struct Function {
  double (*value_of)(double);
  double (*slope_of)(double);
  double (*curvature_of)(double);
  double magnitude = 1;  ///< size of the terms of the value

  PotentialValue value(const Eigen::VectorXd& x) { return {value_of(x[0]), magnitude}; }
  PotentialEvaluation evaluate(const Eigen::VectorXd& x, Eigen::VectorXd& gradient) {
    gradient[0] = slope_of(x[0]);
    return {value(x), 1};
  }
  PotentialEvaluation evaluate(const Eigen::VectorXd& x, Eigen::VectorXd& gradient, Eigen::MatrixXd& second) {
    hessian(x, Tangent::kExact, second);
    return evaluate(x, gradient);
  }
  void hessian(const Eigen::VectorXd& x, Tangent tangent, Eigen::MatrixXd& second) {
    const double exact = curvature_of(x[0]);
    second(0, 0) = tangent == Tangent::kExact ? exact : std::abs(exact);
  }
  void accept(PotentialEvaluation&) {}
};

/// |x| with a round tip: full steps from beyond 1 go to -x^3.
Function rounded_cone() {
  return {[](double x) { return std::sqrt(1 + x * x); }, [](double x) { return x / std::sqrt(1 + x * x); },
          [](double x) { return std::pow(1 + x * x, -1.5); }};
}

struct LowestOfFunction : Function {
  static constexpr bool kSeeksLowest = true;
};

/// Minima at -1 and 1, concave between -0.58 and 0.58.
Function two_wells() {
  return {[](double x) { return 0.25 * std::pow(x * x - 1, 2); }, [](double x) { return x * (x * x - 1); },
          [](double x) { return 3 * x * x - 1; }};
}

/// A quadratic whose directions a series of one term turns uphill.
struct Uphill : Function {
  Uphill() : Function{[](double x) { return 0.5 * x * x; }, [](double x) { return x; }, [](double) { return 1.0; }} {}
  Eigen::VectorXd product;
  int gyroscopic_terms() { return 1; }
  const Eigen::VectorXd& gyroscopic_product(const Eigen::VectorXd& x) { return product = 3 * x; }
};

template <class Problem>
NewtonReport minimise(Problem problem, double& at, const NewtonPolicy& policy = {}) {
  Eigen::VectorXd x = Eigen::VectorXd::Constant(1, at);
  NewtonWorkspace workspace(1);
  workspace.policy = policy;
  const NewtonReport report = newton_minimise(problem, {}, x, workspace);
  at = x[0];
  return report;
}

/// Keeps its Hessian itself, which projected tangents leave indefinite, as those of an island may be.
struct Indefinite : Function {
  double kept = 0, factor = 0;
  PotentialEvaluation evaluate(const Eigen::VectorXd& x, Eigen::VectorXd& gradient) {
    return Function::evaluate(x, gradient);
  }
  PotentialEvaluation evaluate(const Eigen::VectorXd& x, Eigen::VectorXd& gradient, Eigen::MatrixXd& second) {
    hessian(x, Tangent::kExact, second);
    return evaluate(x, gradient);
  }
  void hessian(const Eigen::VectorXd& x, Tangent /*tangent*/, Eigen::MatrixXd& /*second*/) {
    kept = curvature_of(x[0]);
  }
  bool factorise() {
    factor = kept;
    return factor > 0;
  }
  void shift(double share) { kept += share; }
  void solve(Eigen::Map<Eigen::VectorXd>& x) { x /= factor; }
};

TEST(Newton, ShiftsTheHessianThatAProblemKeepsItself) {
  double x = 0.1;
  EXPECT_EQ(minimise(Indefinite{two_wells()}, x).status, NewtonStatus::kConverged);
  EXPECT_NEAR(std::abs(x), 1, 1e-6);
}

TEST(Newton, LineSearchStopsFullStepsFromDiverging) {
  double x = 2;
  EXPECT_EQ(minimise(rounded_cone(), x).status, NewtonStatus::kConverged);
  EXPECT_NEAR(x, 0, 1e-6);
  x = 2;
  EXPECT_NE(minimise(rounded_cone(), x, {.line_search = false}).status, NewtonStatus::kConverged);
}

// The first length that is low enough, 1/32, goes from 7.9 to -7.75, the next one to 0.07.
TEST(Newton, HalvesOnForAsLongAsThePotentialFalls) {
  double x = 7.9;
  EXPECT_GE(minimise(rounded_cone(), x).iterations, 7);
  EXPECT_NEAR(x, 0, 1e-6);
  x = 7.9;
  const NewtonReport report = minimise(LowestOfFunction{rounded_cone()}, x);
  EXPECT_EQ(report.status, NewtonStatus::kConverged);
  EXPECT_LE(report.iterations, 4);
  EXPECT_NEAR(x, 0, 1e-6);
}

TEST(Newton, ProjectionLeavesAConcavePlace) {
  double x = 0.1;
  const NewtonReport report = minimise(two_wells(), x);
  EXPECT_EQ(report.status, NewtonStatus::kConverged);
  EXPECT_GE(report.projections, 1);
  EXPECT_NEAR(x, 1, 1e-6);
  x = 0.1;
  EXPECT_EQ(minimise(two_wells(), x, {.projection = false}).status, NewtonStatus::kStagnated);
  EXPECT_EQ(x, 0.1);
}

/// x^2 / 2 - b x
Function parabola() {
  return {[](double x) { return 0.5 * x * x - 3 * x; }, [](double x) { return x - 3; }, [](double) { return 1.0; }};
}

TEST(Newton, GoesOnWithTheFactorOfAnEarlierMinimisation) {
  Function first = parabola(), second = rounded_cone();
  Eigen::VectorXd x = Eigen::VectorXd::Constant(1, 1);
  NewtonWorkspace workspace(1);
  EXPECT_EQ(newton_minimise(first, {}, x, workspace).factorisations, 1);
  // The same function from elsewhere: the factor is exact.
  x[0] = -8;
  const NewtonReport again = newton_minimise(first, {}, x, workspace, NewtonBegin::kFactor);
  EXPECT_EQ(again.status, NewtonStatus::kConverged);
  EXPECT_EQ(again.factorisations, 0);
  EXPECT_EQ(again.iterations, 1);
  EXPECT_NEAR(x[0], 3, 1e-6);
  // Another one, whose curvature there is 5 times as low: it does not serve for long.
  x[0] = 1.4;
  const NewtonReport other = newton_minimise(second, {}, x, workspace, NewtonBegin::kFactor);
  EXPECT_EQ(other.status, NewtonStatus::kConverged);
  EXPECT_GE(other.factorisations, 1);
  EXPECT_NEAR(x[0], 0, 1e-6);
}

TEST(Newton, GoesDownWhereASeriesPointsUp) {
  double x = 1;
  EXPECT_EQ(minimise(Uphill(), x).status, NewtonStatus::kConverged);
  EXPECT_NEAR(x, 0, 1e-6);
}

// The potential is so large that no line search can tell the points apart, and the step makes the gradient grow.
TEST(Newton, TakesBackAnUncheckedStepThatRaisesTheResidual) {
  Function cone = rounded_cone();
  cone.magnitude = 1e30;
  double x = 2;
  const NewtonReport report = minimise(cone, x);
  EXPECT_EQ(report.status, NewtonStatus::kStagnated);
  EXPECT_EQ(x, 2);
  EXPECT_NEAR(report.residual, 2 / std::sqrt(5.0), 1e-15);
}

}  // namespace
}  // namespace exmat::runtime
