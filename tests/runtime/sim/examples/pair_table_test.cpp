#include "runtime/sim/examples/pair_table.h"

#include <cmath>
#include <gtest/gtest.h>
#include <vector>

#include "runtime/sim/examples/bernstein_basis.h"
#include "tests/runtime/sim/examples/table_values.h"
#include "tests/support/allocation_counter.h"

namespace exmat::runtime {
namespace pair_table_test {

using test::derivative;
using test::evaluate;
using test::random_weights;

constexpr Eigen::Index kModes = 11, kExamples = 6;

/// A polynomial of degree 2 in all weights has no more than two of them in a term: as one polynomial, and as terms.
struct Quadratic {
  TargetTableData whole, terms;
};

Quadratic quadratic() {
  const BernsteinBasis basis(2, kExamples);
  Quadratic made;
  made.whole.degree = made.terms.degree = 2;
  made.whole.exponents = basis.exponents();
  made.whole.control_points = test::random_matrix(basis.size(), kModes, 1);
  const auto point = [&](Eigen::Index i, Eigen::Index j) -> Eigen::RowVectorXd {
    const Eigen::VectorXi exponents = Eigen::VectorXi::Unit(kExamples, i) + Eigen::VectorXi::Unit(kExamples, j);
    return made.whole.control_points.row(basis.number(exponents));
  };
  const auto add = [&](const Eigen::RowVectorXi& exponents, const Eigen::RowVectorXd& control_point) {
    IndexMatrix& rows = made.terms.exponents;
    RowMatrix& points = made.terms.control_points;
    rows.conservativeResize(rows.rows() + 1, kExamples);
    points.conservativeResize(points.rows() + 1, kModes);
    rows.bottomRows<1>() = exponents;
    points.bottomRows<1>() = control_point;
  };
  add(Eigen::RowVectorXi::Zero(kExamples), point(0, 0));
  for (Eigen::Index k = 1; k < kExamples; ++k) {
    add(Eigen::RowVectorXi::Unit(kExamples, 0) + Eigen::RowVectorXi::Unit(kExamples, k), point(0, k) - point(0, 0));
    add(2 * Eigen::RowVectorXi::Unit(kExamples, k), point(k, k) - point(0, 0));
  }
  for (Eigen::Index k = 1; k < kExamples; ++k)
    for (Eigen::Index l = k + 1; l < kExamples; ++l)
      add(Eigen::RowVectorXi::Unit(kExamples, k) + Eigen::RowVectorXi::Unit(kExamples, l),
          point(k, l) - point(0, k) - point(0, l) + point(0, 0));
  return made;
}

/// Terms of degrees 1 to 4 of single examples, and of 2, 3 and 4 of some pairs.
TargetTableData mixed_terms() {
  std::vector<Eigen::RowVectorXi> rows{Eigen::RowVectorXi::Zero(kExamples)};
  for (int k = 1; k < kExamples; ++k) {
    const int degree = 1 + k % 4;
    for (int a = 1; a <= degree; ++a) {
      rows.emplace_back(Eigen::RowVectorXi::Zero(kExamples));
      rows.back()[0] = degree - a;
      rows.back()[k] = a;
    }
  }
  for (int k = 1; k < 4; ++k) {
    const int degree = 1 + k, l = k + 2;
    for (int a = 1; a < degree; ++a)
      for (int b = 1; b <= degree - a; ++b) {
        rows.emplace_back(Eigen::RowVectorXi::Zero(kExamples));
        rows.back()[0] = degree - a - b;
        rows.back()[k] = a;
        rows.back()[l] = b;
      }
  }
  TargetTableData data;
  data.degree = 4;
  data.exponents.resize(std::ssize(rows), kExamples);
  for (Eigen::Index n = 0; n < data.exponents.rows(); ++n) data.exponents.row(n) = rows[static_cast<std::size_t>(n)];
  data.control_points = test::random_matrix(data.exponents.rows(), kModes, 2);
  return data;
}

/// Inside the simplex, and with some weights zero.
std::vector<Eigen::VectorXd> weights_of_all_kinds() {
  std::vector<Eigen::VectorXd> all;
  for (std::uint32_t seed = 0; seed < 20; ++seed) {
    Eigen::VectorXd w = random_weights(kExamples, seed + 1);
    all.push_back(w);
    for (const Eigen::Index k : {seed % kExamples, (seed + 2) % kExamples, (2 * seed + 1) % kExamples}) w[k] = 0;
    all.emplace_back(w / w.sum());
  }
  return all;
}

TEST(PairTable, OfAQuadraticIsTheOnePolynomial) {
  const Quadratic made = quadratic();
  const TargetTable whole(made.whole), terms(made.terms);
  EXPECT_FALSE(whole.is_of_pairs());
  EXPECT_TRUE(terms.is_of_pairs());
  for (const Eigen::VectorXd& w : weights_of_all_kinds()) {
    EXPECT_LE((evaluate(terms, w) - evaluate(whole, w)).norm(), 1e-14 * made.whole.control_points.norm());
    EXPECT_LE((derivative(terms, w) - derivative(whole, w)).norm(), 1e-13 * made.whole.control_points.norm());
  }
}

TEST(PairTable, IsTheSumOfItsTermsByDefinition) {
  const TargetTableData data = mixed_terms();
  const TargetTable table(data);
  for (const Eigen::VectorXd& w : weights_of_all_kinds()) {
    Eigen::VectorXd expected = Eigen::VectorXd::Zero(kModes);
    for (Eigen::Index n = 0; n < data.exponents.rows(); ++n) {
      const Eigen::RowVectorXi a = data.exponents.row(n);
      double value = std::tgamma(a.sum() + 1.0), left = 1;
      for (Eigen::Index k = 1; k < kExamples; ++k) {
        value *= std::pow(w[k], a[k]) / std::tgamma(a[k] + 1.0);
        if (a[k] > 0) left -= w[k];
      }
      expected += value * std::pow(left, a[0]) / std::tgamma(a[0] + 1.0) * data.control_points.row(n).transpose();
    }
    EXPECT_LE((evaluate(table, w) - expected).norm(), 1e-13 * expected.norm());
  }
}

TEST(PairTable, ExamplesAreTheConstantAndTheLastOfTheirTerm) {
  const TargetTableData data = mixed_terms();
  const TargetTable table(data);
  EXPECT_EQ(evaluate(table, Eigen::VectorXd::Unit(kExamples, 0)), data.control_points.row(0).transpose());
  for (Eigen::Index n = 1; n < data.exponents.rows(); ++n)
    for (Eigen::Index k = 1; k < kExamples; ++k)
      if (data.exponents(n, k) > 0 && data.exponents(n, k) == data.exponents.row(n).sum()) {
        EXPECT_EQ(evaluate(table, Eigen::VectorXd::Unit(kExamples, k)),
                  (data.control_points.row(0) + data.control_points.row(n)).transpose());
      }
}

// Central differences of a polynomial of degree 4 between two points of the simplex: their error is step^2 times its
// third derivative.
TEST(PairTable, DerivativeIsThatOfDifferences) {
  const TargetTable table(mixed_terms());
  constexpr double kStep = 1e-4;
  for (std::uint32_t seed = 1; seed < 20; ++seed) {
    const Eigen::VectorXd w = random_weights(kExamples, seed), along = random_weights(kExamples, seed + 50) - w;
    const Eigen::VectorXd expected =
        (evaluate(table, w + kStep * along) - evaluate(table, w - kStep * along)) / (2 * kStep);
    EXPECT_LE((derivative(table, w) * along - expected).norm(), 1e-6 * (1 + expected.norm()));
    EXPECT_LE((derivative(table, w) * w).norm(), 1e-12);
  }
}

TEST(PairTable, AllocatesNothing) {
  if (!test::AllocationCounter::works()) GTEST_SKIP() << "a sanitizer owns malloc";
  const TargetTable table(mixed_terms());
  auto workspace = table.make_workspace();
  Eigen::VectorXd target(kModes);
  Eigen::MatrixXd jacobian(kModes, kExamples);
  const Eigen::VectorXd w = random_weights(kExamples, 1);
  std::size_t allocations = 0;
  {
    const test::AllocationCounter counter;
    table.evaluate(w, workspace, target);
    table.derivative(w, workspace, jacobian);
    allocations = counter.count();
  }
  EXPECT_EQ(allocations, 0U);
}

}  // namespace pair_table_test
}  // namespace exmat::runtime
