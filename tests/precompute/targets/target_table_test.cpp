#include "precompute/targets/target_table.h"

#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>
#include <omp.h>
#include <random>

#include "common/config/config.h"
#include "common/core/decompositions.h"
#include "precompute/full_space/full_space_examples.h"
#include "precompute/pipeline/build_reduced_model.h"
#include "runtime/sim/examples/target.h"
#include "runtime/sim/examples/target_table.h"
#include "tests/support/synthetic_model.h"

namespace exmat::precompute {
namespace target_table_test {

using runtime::TargetSolver;
using runtime::TargetTable;

/// Bend, twist, stretch, `strength` times those of the synthetic bar; the energy at rest is stiff against its twist,
/// so strong ones have no table.
ReducedModel small_model(int examples, double strength) {
  test::Bar bar = test::make_bar({.cells = {4, 1, 1}, .linear_modes = 6, .eigenfunctions = 4, .examples = examples});
  for (ExampleData& example : bar.model.examples->examples) example.pose *= strength;
  return bar.model;
}

TargetSolver solver_of(const ReducedModel& model, EnergyReference reference) {
  TargetSolver solver;
  const auto complaint = solver.build(MaterialModel::kStVenantKirchhoff, *model.cubature, model.examples->examples,
                                      model.projection->target_basis, reference);
  EXPECT_FALSE(complaint) << to_string(*complaint);
  return solver;
}

/// Table of targets in the modal basis of a model: the complaint of a pose that inverts an element is the message.
std::optional<TargetTableData> table_of(const ReducedModel& model, const TargetTableOptions& options,
                                        TargetTableReport& report) {
  TargetSolver solver;
  if (const auto complaint = solver.build(model.object->materials.model, *model.cubature, model.examples->examples,
                                          model.projection->target_basis, options.energy_reference)) {
    report.message = to_string(*complaint);
    return std::nullopt;
  }
  Eigen::MatrixXd poses(model.modal->basis.cols(), std::ssize(model.examples->examples));
  for (Eigen::Index k = 0; k < poses.cols(); ++k)
    poses.col(k) = model.examples->examples[static_cast<std::size_t>(k)].pose;
  return build_target_table(solver, poses, options, report);
}

double largest_example(const TargetSolver& solver, Eigen::Index examples) {
  double largest = 0;
  for (Eigen::Index k = 0; k < examples; ++k) largest = std::max(largest, solver.example(k).norm());
  return largest;
}

Eigen::VectorXd solve(const TargetSolver& solver, const Eigen::VectorXd& weights) {
  auto workspace = solver.make_workspace();
  Eigen::VectorXd y(solver.dimension());
  solver.start(weights, y);
  EXPECT_LE(solver.solve(weights, workspace, y).residual, 1e-8 * largest_example(solver, weights.size()));
  return y;
}

/// Weights that the table has not seen: uniform inside the simplex, on its faces and edges, and its corners.
std::vector<Eigen::VectorXd> random_weights(int examples, int count) {
  std::mt19937 generator(7);
  std::exponential_distribution<double> exponential;
  std::vector<Eigen::VectorXd> all;
  for (int i = 0; i < count; ++i)
    for (std::uint32_t members = 1; members < (1U << examples); ++members) {
      Eigen::VectorXd w = Eigen::VectorXd::Zero(examples);
      for (int k = 0; k < examples; ++k)
        if ((members >> k & 1U) != 0) w[k] = exponential(generator);
      all.push_back(w / w.sum());
    }
  return all;
}

/// Largest error of the table against the solver, in the energy norm at rest, relative to the largest example.
double largest_error(const TargetTableData& data, const TargetSolver& solver,
                     const std::vector<Eigen::VectorXd>& weights) {
  const Eigen::Index examples = weights.front().size();
  const TargetTable table(data);
  auto workspace = table.make_workspace();
  const Eigen::HouseholderQR<Eigen::MatrixXd> basis(solver.basis());
  Eigen::VectorXd target(table.modes());
  double largest = 0;
  for (const Eigen::VectorXd& w : weights) {
    table.evaluate(w, workspace, target);
    const Eigen::VectorXd y = basis.solve(target);
    EXPECT_LE((solver.basis() * y - target).norm(), 1e-9 * solver.basis().norm() * largest_example(solver, examples));
    largest = std::max(largest, (y - solve(solver, w)).norm());
  }
  return largest / largest_example(solver, examples);
}

bool identical(const TargetTableData& a, const TargetTableData& b) {
  return a.degree == b.degree && a.exponents == b.exponents && a.control_points == b.control_points &&
         a.error == b.error && a.energy_reference == b.energy_reference && a.knots == b.knots;
}

struct Case {
  int examples;
  EnergyReference reference;
  double strength, tolerance;
};
void PrintTo(const Case& c, std::ostream* out) {
  *out << "K " << c.examples << " " << name_of(c.reference) << " strength " << c.strength << " tolerance "
       << c.tolerance;
}

class TargetTablePrecompute : public ::testing::TestWithParam<Case> {
 protected:
  TargetTablePrecompute()
      : model_(small_model(GetParam().examples, GetParam().strength)), solver_(solver_of(model_, reference())) {}

  int examples() const { return GetParam().examples; }
  EnergyReference reference() const { return GetParam().reference; }
  double tolerance() const { return GetParam().tolerance; }
  TargetTableData build() {
    const auto data = table_of(model_, {.tolerance = tolerance(), .energy_reference = reference()}, report_);
    EXPECT_TRUE(data) << report_.message;
    return data.value_or(TargetTableData{});
  }

  ReducedModel model_;
  TargetSolver solver_;
  TargetTableReport report_;
};

INSTANTIATE_TEST_SUITE_P(
    Cases, TargetTablePrecompute,
    ::testing::Values(Case{2, EnergyReference::kExample, 1, 1e-3}, Case{2, EnergyReference::kExample, 1, 1e-5},
                      Case{2, EnergyReference::kExample, 1, 1e-7}, Case{2, EnergyReference::kRest, 1, 1e-3},
                      Case{2, EnergyReference::kRest, 1, 1e-5}, Case{2, EnergyReference::kRest, 1, 1e-7},
                      Case{3, EnergyReference::kExample, 1, 1e-3}, Case{3, EnergyReference::kExample, 1, 1e-4},
                      Case{3, EnergyReference::kExample, 0.5, 1e-7}, Case{3, EnergyReference::kRest, 0.3, 1e-3},
                      Case{3, EnergyReference::kRest, 0.2, 1e-5}, Case{4, EnergyReference::kExample, 0.7, 1e-3},
                      Case{4, EnergyReference::kExample, 0.5, 1e-5}, Case{4, EnergyReference::kRest, 0.15, 1e-3}));

// The largest error over other weights: never above the tolerance, and no further from the recorded one than maxima
// over different samples of a function that oscillates are.
TEST_P(TargetTablePrecompute, ErrorIsWhatTheBundleSaysAndBelowTheTolerance) {
  const TargetTableData data = build();
  const double found = largest_error(data, solver_, random_weights(examples(), 40));
  EXPECT_LE(found, tolerance());
  EXPECT_LE(found, 1.4 * data.error);
  EXPECT_GE(found, 0.4 * data.error);
  EXPECT_EQ(data.error, report_.error);
  EXPECT_EQ(data.degree, report_.degree);
  EXPECT_EQ(data.energy_reference, reference());
  EXPECT_EQ(data.knots, Eigen::Vector2d(0, 1));
  EXPECT_EQ(report_.pieces, 1);
  for (std::size_t i = 0; i + 1 < report_.fits.size(); ++i) EXPECT_GT(report_.fits[i].error, 0.5 * tolerance());
}

TEST_P(TargetTablePrecompute, CornersAreTheExamplesExactly) {
  const TargetTable table(build());
  auto workspace = table.make_workspace();
  Eigen::VectorXd target(table.modes());
  for (int k = 0; k < examples(); ++k) {
    table.evaluate(Eigen::VectorXd::Unit(examples(), k), workspace, target);
    EXPECT_EQ(target, model_.examples->examples[static_cast<std::size_t>(k)].pose);
  }
}

/// The Hessian of sum_k w_k E_k by five-point differences of its gradient.
Eigen::MatrixXd difference_hessian(const TargetSolver& solver, const Eigen::VectorXd& weights, const Eigen::VectorXd& y,
                                   double h) {
  auto workspace = solver.make_workspace();
  Eigen::MatrixXd hessian(y.size(), y.size());
  for (Eigen::Index i = 0; i < y.size(); ++i) {
    const auto at = [&](double offset) {
      Eigen::VectorXd force(y.size());
      solver.force(weights, y + offset * h * Eigen::VectorXd::Unit(y.size(), i), workspace, force);
      return force;
    };
    hessian.col(i) = (at(-2) - 8 * at(-1) + 8 * at(1) - at(2)) / (12 * h);
  }
  return hessian;
}

// sum_k w_k grad E_k(y) = 0 along w + t (1_k - 1_0): H dy/dt = grad E_0 - grad E_k.
TEST_P(TargetTablePrecompute, DerivativeIsThatOfTheImplicitFunction) {
  const TargetTableData data = build();
  const TargetTable table(data);
  const double scale = largest_example(solver_, examples());
  const Eigen::HouseholderQR<Eigen::MatrixXd> basis(solver_.basis());
  auto workspace = table.make_workspace();
  auto solver_workspace = solver_.make_workspace();
  Eigen::MatrixXd jacobian(table.modes(), examples());
  const auto gradient = [&](int k, const Eigen::VectorXd& y) {
    Eigen::VectorXd force(y.size());
    solver_.force(Eigen::VectorXd::Unit(examples(), k), y, solver_workspace, force);
    return force;
  };
  for (const Eigen::VectorXd& w : random_weights(examples(), 2)) {
    table.derivative(w, workspace, jacobian);
    const Eigen::VectorXd y = solve(solver_, w);
    const Eigen::PartialPivLU<Eigen::MatrixXd> hessian(difference_hessian(solver_, w, y, 1e-3 * scale));
    for (int k = 1; k < examples(); ++k) {
      const Eigen::VectorXd expected = hessian.solve(gradient(0, y) - gradient(k, y));
      const Eigen::VectorXd found = basis.solve(jacobian.col(k) - jacobian.col(0));
      // Markov's inequality: a polynomial of degree D within e on an edge has a slope of at most 2 D^2 e there. Twice
      // that, as p* is no polynomial.
      const double allowed = 4 * static_cast<double>(data.degree * data.degree) * data.error;
      EXPECT_LE((found - expected).norm(), (allowed + 1e-7) * scale) << w.transpose();
    }
  }
}

TEST(TargetTableDeterminism, TheSameInEveryRunAndForAnyNumberOfThreads) {
  const ReducedModel model = small_model(3, 0.5);
  const auto with_threads = [&](int threads) {
    const int before = omp_get_max_threads();
    omp_set_num_threads(threads);
    TargetTableReport report;
    const auto data = table_of(model, {.tolerance = 1e-4}, report);
    omp_set_num_threads(before);
    EXPECT_TRUE(data) << report.message;
    return *data;
  };
  const TargetTableData one = with_threads(1);
  EXPECT_TRUE(identical(one, with_threads(1)));
  EXPECT_TRUE(identical(one, with_threads(2)));
  EXPECT_TRUE(identical(one, with_threads(3)));
}

/// The rest pose and a stretch by `strain`. By the energy at rest of St.Venant-Kirchhoff, a body turned inside out
/// along an axis is as good as at rest: each example has a second minimum two units of strain below its own.
ReducedModel stretched_model(double strain) {
  constexpr double kStrainOfTheBar = 0.15;
  ReducedModel model = small_model(4, strain / kStrainOfTheBar);
  std::vector<ExampleData>& examples = model.examples->examples;
  examples = {examples[0], examples[3]};
  return model;
}

/// The lowest minimum that is reached from either example.
Eigen::VectorXd lowest_minimum(const TargetSolver& solver, const Eigen::VectorXd& weights) {
  auto workspace = solver.make_workspace();
  Eigen::VectorXd first = solver.example(0), second = solver.example(1);
  solver.solve(weights, workspace, first);
  solver.solve(weights, workspace, second);
  return solver.energy(weights, first, workspace) < solver.energy(weights, second, workspace) ? first : second;
}

TEST(TargetTableRefusal, WhereTheTargetJumps) {
  const ReducedModel model = stretched_model(1.6);
  const TargetSolver solver = solver_of(model, EnergyReference::kRest);
  double largest_step = 0;
  Eigen::VectorXd y = solver.example(0);
  for (int i = 1; i <= 400; ++i) {
    const Eigen::VectorXd next = lowest_minimum(solver, Eigen::Vector2d(1 - i / 400.0, i / 400.0));
    largest_step = std::max(largest_step, (next - y).norm());
    y = next;
  }
  ASSERT_GT(largest_step, 0.2 * solver.example(1).norm());

  TargetTableReport report;
  EXPECT_FALSE(table_of(model, {.tolerance = 0.05, .energy_reference = EnergyReference::kRest}, report));
  EXPECT_NE(report.message.find("more than one minimum"), std::string::npos) << report.message;
  EXPECT_GT(report.pieces, 1);
  EXPECT_TRUE(table_of(stretched_model(0.5), {.tolerance = 0.05, .energy_reference = EnergyReference::kRest}, report));
}

/// By the energy of the examples, a strong stretch bends p*(w) sharply: no polynomial of degree 40 follows.
class SharpBend : public ::testing::TestWithParam<double> {
 protected:
  SharpBend() : model_(stretched_model(0.9)), solver_(solver_of(model_, EnergyReference::kExample)) {}

  double tolerance() const { return GetParam(); }
  TargetTableData build(const TargetTableOptions& options) {
    const auto data = table_of(model_, options, report_);
    EXPECT_TRUE(data) << report_.message;
    return data.value_or(TargetTableData{});
  }
  TargetTableData build() { return build({.tolerance = tolerance()}); }
  /// By the weight of the second example, in the coordinates of the solver.
  Eigen::VectorXd slope(const TargetTable& table, double t) const {
    auto workspace = table.make_workspace();
    Eigen::MatrixXd jacobian(table.modes(), 2);
    table.derivative(Eigen::Vector2d(1 - t, t), workspace, jacobian);
    return solver_.basis().householderQr().solve(jacobian.col(1) - jacobian.col(0));
  }
  Eigen::VectorXd value(const TargetTable& table, double t) const {
    auto workspace = table.make_workspace();
    Eigen::VectorXd target(table.modes());
    table.evaluate(Eigen::Vector2d(1 - t, t), workspace, target);
    return solver_.basis().householderQr().solve(target);
  }

  ReducedModel model_;
  TargetSolver solver_;
  TargetTableReport report_;
};

INSTANTIATE_TEST_SUITE_P(Tolerances, SharpBend, ::testing::Values(1e-3, 1e-4, 1e-6));

TEST_P(SharpBend, TakesPiecesWithinTheTolerance) {
  const TargetTableData data = build();
  EXPECT_GT(report_.pieces, 1);
  EXPECT_EQ(data.knots.size(), report_.pieces + 1);
  EXPECT_EQ(data.control_points.rows(), report_.pieces * data.exponents.rows());
  EXPECT_EQ(data.error, report_.error);
  EXPECT_EQ(data.degree, report_.degree);
  ASSERT_GE(report_.fits.size(), 2U);
  EXPECT_GT(report_.fits[report_.fits.size() - 2].error, tolerance());  // of degree 40
  const double found = largest_error(data, solver_, random_weights(2, 1000));
  EXPECT_LE(found, tolerance());
  EXPECT_LE(found, 1.4 * data.error);
  EXPECT_GE(found, 0.4 * data.error);
}

TEST_P(SharpBend, PiecesMeetWithTheirSlopes) {
  const TargetTableData data = build();
  const TargetTable table(data);
  const double scale = largest_example(solver_, 2);
  for (Eigen::Index i = 1; i + 1 < data.knots.size(); ++i) {
    const double t = data.knots[i], before = std::nextafter(t, 0.0);
    const double rounding = 1e-13 * scale / std::min(t - data.knots[i - 1], data.knots[i + 1] - t);
    EXPECT_LE((value(table, t) - value(table, before)).norm(), 1e-13 * scale);
    EXPECT_LE((slope(table, t) - slope(table, before)).norm(), rounding);
  }
}

TEST_P(SharpBend, AtItsKnotsAreTheTargetAndItsDerivative) {
  const TargetTableData data = build();
  const TargetTable table(data);
  const double scale = largest_example(solver_, 2);
  auto workspace = solver_.make_workspace();
  for (const double t : data.knots) {
    const Eigen::Vector2d w(1 - t, t);
    const Eigen::VectorXd y = solve(solver_, w);
    Eigen::VectorXd first(y.size()), second(y.size());
    solver_.force(Eigen::Vector2d(1, 0), y, workspace, first);
    solver_.force(Eigen::Vector2d(0, 1), y, workspace, second);
    const Eigen::PartialPivLU<Eigen::MatrixXd> hessian(difference_hessian(solver_, w, y, 1e-3 * scale));
    const Eigen::VectorXd expected = hessian.solve(first - second);
    EXPECT_LE((value(table, t) - y).norm(), 1e-8 * scale) << t;
    EXPECT_LE((slope(table, t) - expected).norm(), 1e-5 * expected.norm() + 1e-7 * scale) << t;
  }
}

TEST_P(SharpBend, EndsAreTheExamplesExactly) {
  const TargetTable table(build());
  auto workspace = table.make_workspace();
  Eigen::VectorXd target(table.modes());
  for (int k = 0; k < 2; ++k) {
    table.evaluate(Eigen::VectorXd::Unit(2, k), workspace, target);
    EXPECT_EQ(target, model_.examples->examples[static_cast<std::size_t>(k)].pose);
  }
}

TEST_P(SharpBend, TheSameInEveryRunAndForAnyNumberOfThreads) {
  const int before = omp_get_max_threads();
  omp_set_num_threads(1);
  const TargetTableData one = build();
  EXPECT_TRUE(identical(one, build()));
  for (const int threads : {2, 3}) {
    omp_set_num_threads(threads);
    EXPECT_TRUE(identical(one, build())) << threads;
  }
  omp_set_num_threads(before);
}

// Its twist sets in all at once, at a weight of about 0.05. The pull of the bundle's table against that of targets on
// the whole mesh, filtered there: the tolerance is of targets in the energy norm, in which their rigid turns weigh
// nothing and their stretch most, so that pulls are allowed ten times as much.
TEST(TargetTableOfTheTwistedBar, IsWithinTheDefaultTolerance) {
  AssetConfig asset = load_asset(EXMAT_SOURCE_DIR "/examples/01_twisted_bar/asset.json");
  asset.training.from = Training::kNone;
  BuildReport report;
  const ReducedModel model = build_reduced_model(asset, resolve_needs(asset, std::nullopt), report);
  ASSERT_TRUE(model.targets);
  EXPECT_TRUE(model.targets->is_pull);
  EXPECT_LE(model.targets->control_points.rows(), 100);
  EXPECT_LE(model.targets->error, asset.target_tolerance);
  const ObjectData& object = *model.object;
  const ElasticSystem system = build_elastic_system(object.mesh, object.materials, object.fixed);
  const FullSpaceExamples full(model, system, whole_body_example_poses(model, system), EnergyReference::kExample);
  const Eigen::MatrixXd basis = system.restrict(model.modal->basis);
  const TargetTable table(*model.targets);
  auto scratch = table.make_workspace();
  Eigen::VectorXd pull(table.modes());
  double largest = 0, difference = 0;
  for (const Eigen::VectorXd& w : random_weights(2, 40)) {
    const Eigen::VectorXd y = solve(full.target(), w);
    const Eigen::VectorXd exact = basis.transpose() * full.filter(full.target_fields() * y);
    table.evaluate(w, scratch, pull);
    largest = std::max(largest, exact.norm());
    difference = std::max(difference, (pull - exact).norm());
  }
  EXPECT_LE(difference, 10 * asset.target_tolerance * largest);
}

TEST(TargetTableRefusal, WhereThePiecesAreNotEnough) {
  TargetTableReport report;
  EXPECT_FALSE(table_of(stretched_model(0.9), {.tolerance = 1e-4, .most_pieces = 3}, report));
  EXPECT_LE(report.pieces, 3);
  EXPECT_GT(report.pieces, 1);
  EXPECT_GT(report.error, 1e-4);
  for (const char* part : {"no table of targets", "at degree 40", " pieces of degree ", "\"target\": \"solve\""})
    EXPECT_NE(report.message.find(part), std::string::npos) << report.message;
}

TEST(TargetTableRefusal, WhereTheDegreeIsNotEnough) {
  TargetTableReport report;
  const ReducedModel model = small_model(3, 1);
  EXPECT_FALSE(table_of(model, {.tolerance = 1e-6, .most_degree = 6}, report));
  EXPECT_EQ(report.degree, 6);
  EXPECT_GT(report.error, 1e-6);
  EXPECT_EQ(report.fits.size(), 2U);
  for (const char* part : {"no table of targets", "at degree 6", "\"target\": \"solve\"", "targets.tolerance"})
    EXPECT_NE(report.message.find(part), std::string::npos) << report.message;
}

TEST(TargetTableRefusal, OfTooFewExamples) {
  TargetTableReport report;
  EXPECT_FALSE(table_of(small_model(1, 0.5), {}, report));
  EXPECT_NE(report.message.find("no table of targets"), std::string::npos);
  EXPECT_EQ(report.solves, 0);
}

class TargetsOfManyExamples : public ::testing::TestWithParam<EnergyReference> {
 protected:
  static constexpr int kExamples = 7;
  static constexpr double kTolerance = 2e-3;

  TargetsOfManyExamples() : model_(small_model(kExamples, 0.4)), solver_(solver_of(model_, GetParam())) {}

  TargetTableData build() {
    const auto data = table_of(model_, {.tolerance = kTolerance, .energy_reference = GetParam()}, report_);
    EXPECT_TRUE(data) << report_.message;
    return data.value_or(TargetTableData{});
  }
  /// Largest over weights of which `together` are not of the rest pose.
  double error(const TargetTableData& data, int together) const {
    std::vector<Eigen::VectorXd> weights = random_weights(kExamples, 4);
    std::erase_if(weights,
                  [&](const Eigen::VectorXd& w) { return (w.tail(kExamples - 1).array() > 0).count() != together; });
    return largest_error(data, solver_, weights);
  }

  ReducedModel model_;
  TargetSolver solver_;
  TargetTableReport report_;
};
INSTANTIATE_TEST_SUITE_P(References, TargetsOfManyExamples,
                         ::testing::Values(EnergyReference::kExample, EnergyReference::kRest),
                         [](const auto& test) { return std::string(name_of(test.param)); });

// Newton's method at weights that the table has not seen. What more than two examples do to each other is not within
// the tolerance, but within what the table says, as far as maxima over different samples of a function agree.
TEST_P(TargetsOfManyExamples, AreThoseThatAreSolvedFor) {
  const TargetTableData data = build();
  EXPECT_TRUE(is_of_pairs(data.exponents));
  EXPECT_LE(error(data, 1), kTolerance);
  EXPECT_LE(error(data, 2), kTolerance);
  for (const int together : {3, 4, 6}) EXPECT_LE(error(data, together), 1.4 * data.error) << together;
}

TEST_P(TargetsOfManyExamples, AreTheExamplesWhereOneHasAllOfTheWeight) {
  const TargetTable table(build());
  auto workspace = table.make_workspace();
  Eigen::VectorXd target(table.modes());
  for (int k = 0; k < kExamples; ++k) {
    table.evaluate(Eigen::VectorXd::Unit(kExamples, k), workspace, target);
    const Eigen::VectorXd& pose = model_.examples->examples[static_cast<std::size_t>(k)].pose;
    EXPECT_LE((target - pose).norm(), 1e-12 * (1 + pose.norm())) << k;
  }
}

TEST_P(TargetsOfManyExamples, AreTheSameInEveryRunAndForAnyNumberOfThreads) {
  const int before = omp_get_max_threads();
  omp_set_num_threads(1);
  const TargetTableData one = build();
  omp_set_num_threads(3);
  EXPECT_TRUE(identical(one, build()));
  omp_set_num_threads(before);
}

// Within nine tenths of the largest example all of these are.
TEST_P(TargetsOfManyExamples, HaveNoTermOfPairsThatAreTheSumOfTheTwo) {
  const auto loose = table_of(model_, {.tolerance = 0.9, .energy_reference = GetParam()}, report_);
  ASSERT_TRUE(loose);
  EXPECT_LE(loose->control_points.rows(), build().control_points.rows());
  for (Eigen::Index n = 0; n < loose->exponents.rows(); ++n)
    EXPECT_LE((loose->exponents.row(n).tail(kExamples - 1).array() > 0).count(), 1);
}

// One polynomial of three examples, and pieces of two.
TEST(ShiftedTargets, AreFartherByALinearFunctionOfTheWeights) {
  std::mt19937 generator(3);
  std::normal_distribution<double> normal;
  for (const int examples : {2, 3}) {
    TargetTableData data;
    data.degree = 4;
    data.exponents.resize(examples == 2 ? 5 : 15, examples);
    Eigen::Index row = 0;
    for (int a = 4; a >= 0; --a)
      for (int b = 4 - a; b >= (examples == 2 ? 4 - a : 0); --b, ++row) {
        data.exponents(row, 0) = a;
        data.exponents(row, 1) = b;
        if (examples == 3) data.exponents(row, 2) = 4 - a - b;
      }
    if (examples == 2) data.knots = Eigen::Vector4d(0, 0.2, 0.7, 1);
    const Eigen::Index modes = 5, pieces = data.knots.size() - 1;
    data.control_points =
        RowMatrix::NullaryExpr(pieces * data.exponents.rows(), modes, [&] { return normal(generator); });
    const Eigen::MatrixXd shifts = Eigen::MatrixXd::NullaryExpr(modes, examples, [&] { return normal(generator); });
    TargetTableData shifted = data;
    shift_targets(shifts, shifted);
    const TargetTable before(data), after(shifted);
    auto workspace = before.make_workspace();
    Eigen::VectorXd at(modes), there(modes);
    for (const Eigen::VectorXd& w : random_weights(examples, 20)) {
      before.evaluate(w, workspace, at);
      after.evaluate(w, workspace, there);
      EXPECT_LE((there - at - shifts * w).norm(), 1e-14 * (at.norm() + there.norm() + 1));
    }
  }
}

// Terms of one and two examples.
TEST(ShiftedTargets, OfManyExamplesAreFartherByALinearFunctionOfTheWeights) {
  TargetTableData data;
  data.degree = 3;
  data.exponents.resize(7, 5);
  data.exponents << 0, 0, 0, 0, 0,                                                //
      1, 1, 0, 0, 0, 0, 2, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 1,  //
      0, 1, 0, 1, 0;
  const Eigen::Index modes = 4;
  data.control_points = RowMatrix::Random(7, modes);
  const Eigen::MatrixXd shifts = Eigen::MatrixXd::Random(modes, 5);
  TargetTableData shifted = data;
  shift_targets(shifts, shifted);
  const TargetTable before(data), after(shifted);
  auto workspace = before.make_workspace();
  Eigen::VectorXd at(modes), there(modes);
  for (const Eigen::VectorXd& w : random_weights(5, 5)) {
    before.evaluate(w, workspace, at);
    after.evaluate(w, workspace, there);
    EXPECT_LE((there - at - shifts * w).norm(), 1e-14 * (at.norm() + there.norm() + 1));
  }
}

}  // namespace target_table_test
}  // namespace exmat::precompute
