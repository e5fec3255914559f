#include "runtime/sim/examples/target_table.h"

#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>
#include <vector>

#include "tests/runtime/sim/examples/table_values.h"
#include "tests/support/allocation_counter.h"

namespace exmat::runtime {
namespace target_table_test {

using test::derivative;
using test::evaluate;
using test::random_weights;

constexpr Eigen::Index kModes = 13;

struct Shape {
  int degree, examples;
};
void PrintTo(const Shape& shape, std::ostream* out) { *out << "D " << shape.degree << " K " << shape.examples; }

TargetTableData random_table(const Shape& shape, std::uint32_t seed = 1) {
  const BernsteinBasis basis(shape.degree, shape.examples);
  TargetTableData data;
  data.degree = shape.degree;
  data.exponents = basis.exponents();
  data.control_points = test::random_matrix(basis.size(), kModes, seed);
  return data;
}

/// Inside, then on each face, then all corners.
std::vector<Eigen::VectorXd> all_kinds_of_weights(int examples) {
  std::vector<Eigen::VectorXd> all;
  for (std::uint32_t members = 1; members < (1U << examples); ++members)
    for (std::uint32_t seed = 0; seed < 5; ++seed) {
      Eigen::VectorXd w = random_weights(examples, 10 * members + seed);
      for (int k = 0; k < examples; ++k)
        if ((members >> k & 1U) == 0) w[k] = 0;
      all.push_back(w / w.sum());
    }
  return all;
}

/// D!/(a_1! ... a_K!) w^a from its definition.
double bernstein(const Eigen::RowVectorXi& exponents, const Eigen::VectorXd& weights) {
  double logarithm = std::lgamma(exponents.sum() + 1.0);
  double powers = 1;
  for (Eigen::Index k = 0; k < weights.size(); ++k) {
    logarithm -= std::lgamma(exponents[k] + 1.0);
    powers *= std::pow(weights[k], exponents[k]);
  }
  return std::exp(logarithm) * powers;
}

Eigen::VectorXd defined_value(const TargetTableData& data, const Eigen::VectorXd& weights) {
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(data.control_points.cols());
  for (Eigen::Index n = 0; n < data.exponents.rows(); ++n)
    sum += bernstein(data.exponents.row(n), weights) * data.control_points.row(n).transpose();
  return sum;
}

/// The control points of degree D - 1, one step of de Casteljau's algorithm.
TargetTableData casteljau_step(const TargetTableData& data, const Eigen::VectorXd& weights) {
  const int degree = static_cast<int>(data.degree), examples = static_cast<int>(weights.size());
  TargetTableData lower = random_table({degree - 1, examples});
  for (Eigen::Index n = 0; n < lower.exponents.rows(); ++n) {
    lower.control_points.row(n).setZero();
    for (int k = 0; k < examples; ++k) {
      const Eigen::RowVectorXi raised = lower.exponents.row(n) + Eigen::RowVectorXi::Unit(examples, k);
      for (Eigen::Index other = 0; other < data.exponents.rows(); ++other)
        if (data.exponents.row(other) == raised)
          lower.control_points.row(n) += weights[k] * data.control_points.row(other);
    }
  }
  return lower;
}

class TargetTableTest : public ::testing::TestWithParam<Shape> {
 protected:
  TargetTableTest() : data_(random_table(GetParam())), table_(data_) {}

  int examples() const { return GetParam().examples; }
  int degree() const { return GetParam().degree; }

  TargetTableData data_;
  TargetTable table_;
};

INSTANTIATE_TEST_SUITE_P(Shapes, TargetTableTest,
                         ::testing::Values(Shape{1, 2}, Shape{4, 2}, Shape{30, 2}, Shape{60, 2}, Shape{2, 3},
                                           Shape{7, 3}, Shape{24, 3}, Shape{1, 4}, Shape{5, 4}, Shape{12, 4},
                                           Shape{4, 5}));

TEST_P(TargetTableTest, IsTheBernsteinSumOfItsDefinition) {
  for (const Eigen::VectorXd& w : all_kinds_of_weights(examples()))
    EXPECT_LE((evaluate(table_, w) - defined_value(data_, w)).norm(), 1e-12) << w.transpose();
}

TEST_P(TargetTableTest, AgreesWithDeCasteljau) {
  const Eigen::VectorXd w = random_weights(examples(), 1);
  TargetTableData points = data_;
  while (points.degree > 1) points = casteljau_step(points, w);
  const Eigen::VectorXd expected = points.control_points.transpose() * w;
  EXPECT_LE((evaluate(table_, w) - expected).norm(), 1e-13 * degree());
}

TEST_P(TargetTableTest, CornersAreControlPointsExactly) {
  for (Eigen::Index n = 0; n < data_.exponents.rows(); ++n) {
    if (data_.exponents.row(n).maxCoeff() < degree()) continue;
    const Eigen::VectorXd corner = data_.exponents.row(n).transpose().cast<double>() / degree();
    EXPECT_EQ(evaluate(table_, corner), data_.control_points.row(n).transpose());
  }
}

TEST_P(TargetTableTest, ExponentsAreNumberedInOrder) {
  const BernsteinBasis basis(degree(), examples());
  ASSERT_EQ(data_.exponents.rows(), std::lround(std::exp(std::lgamma(degree() + examples()) -
                                                         std::lgamma(degree() + 1.0) - std::lgamma(examples()))));
  for (Eigen::Index n = 0; n < basis.size(); ++n) {
    EXPECT_EQ(data_.exponents.row(n).sum(), degree());
    EXPECT_EQ(basis.number(data_.exponents.row(n)), n);
    if (n == 0) continue;
    const Eigen::RowVectorXi change = data_.exponents.row(n) - data_.exponents.row(n - 1);
    Eigen::Index first = 0;
    while (change[first] == 0) ++first;
    EXPECT_LT(change[first], 0);
  }
}

TEST_P(TargetTableTest, DerivativeIsThatOfNormalisedWeights) {
  const double h = 1e-5 / degree();
  for (std::uint32_t seed = 0; seed < 10; ++seed) {
    const Eigen::VectorXd w = random_weights(examples(), seed);
    const Eigen::MatrixXd jacobian = derivative(table_, w);
    for (int k = 0; k < examples(); ++k) {
      const auto at = [&](double offset) {
        const Eigen::VectorXd moved = w + offset * Eigen::VectorXd::Unit(examples(), k);
        return Eigen::VectorXd(defined_value(data_, moved / moved.sum()));
      };
      const Eigen::VectorXd expected = (at(h) - at(-h)) / (2 * h);
      EXPECT_LE((jacobian.col(k) - expected).norm(), 1e-7 * degree() * degree()) << w.transpose();
    }
  }
}

TEST_P(TargetTableTest, DerivativeAlongTheWeightsVanishes) {
  for (const Eigen::VectorXd& w : all_kinds_of_weights(examples())) {
    const Eigen::MatrixXd jacobian = derivative(table_, w);
    EXPECT_LE((jacobian * w).norm(), 1e-13 * degree());
  }
}

/// Interpolation of a linear function by its own control points: slope and value are exact.
TEST_P(TargetTableTest, ReproducesAnAffineFunction) {
  const Eigen::MatrixXd slope = test::random_matrix(kModes, examples(), 7);
  data_.control_points = (data_.exponents.cast<double>() / degree()) * slope.transpose();
  const TargetTable table(data_);
  for (const Eigen::VectorXd& w : all_kinds_of_weights(examples())) {
    const Eigen::VectorXd value = slope * w;
    EXPECT_LE((evaluate(table, w) - value).norm(), 1e-14 * degree());
    EXPECT_LE((derivative(table, w) - (slope.colwise() - value)).norm(), 1e-13 * degree());
  }
}

TEST_P(TargetTableTest, OnAFaceItIsTheTableOfFewerExamples) {
  if (examples() < 3) GTEST_SKIP() << "faces are corners";
  for (int left_out = 0; left_out < examples(); ++left_out) {
    std::vector<int> kept;
    for (int k = 0; k < examples(); ++k)
      if (k != left_out) kept.push_back(k);
    std::vector<Eigen::Index> rows;
    for (Eigen::Index n = 0; n < data_.exponents.rows(); ++n)
      if (data_.exponents(n, left_out) == 0) rows.push_back(n);
    TargetTableData face;
    face.degree = degree();
    face.exponents = data_.exponents(rows, kept);
    face.control_points = data_.control_points(rows, Eigen::all);
    const TargetTable fewer(face);
    const Eigen::VectorXd w = random_weights(examples() - 1, 3);
    Eigen::VectorXd all = Eigen::VectorXd::Zero(examples());
    all(kept) = w;
    EXPECT_LE((evaluate(table_, all) - evaluate(fewer, w)).norm(), 1e-14);
    EXPECT_LE((derivative(table_, all)(Eigen::all, kept) - derivative(fewer, w)).norm(), 1e-13 * degree());
  }
}

TEST_P(TargetTableTest, TinyWeightsAreExactToo) {
  for (const double tiny : {1e-3, 1e-9, 1e-20, 1e-200, 5e-324}) {
    Eigen::VectorXd w = random_weights(examples(), 5);
    w[examples() - 1] = tiny;
    w[0] += 1 - w.sum();
    EXPECT_LE((evaluate(table_, w) - defined_value(data_, w)).norm(), 1e-12) << tiny;
    EXPECT_TRUE(derivative(table_, w).allFinite());
  }
}

TEST_P(TargetTableTest, EvaluationsDoNotAllocate) {
  if (!test::AllocationCounter::works()) GTEST_SKIP() << "a sanitizer owns malloc";
  auto workspace = table_.make_workspace();
  Eigen::VectorXd target(kModes);
  Eigen::MatrixXd jacobian(kModes, examples());
  const Eigen::VectorXd w = random_weights(examples(), 1);
  std::size_t allocations = 0;
  {
    const test::AllocationCounter counter;
    table_.evaluate(w, workspace, target);
    table_.derivative(w, workspace, jacobian);
    allocations = counter.count();
  }
  EXPECT_EQ(allocations, 0U);
}

/// Value at the arguments of the polar form of a polynomial of K = 2, de Casteljau with another weight in each step.
Eigen::VectorXd blossom(const TargetTableData& data, const std::vector<double>& arguments) {
  RowMatrix points = data.control_points;
  for (const double t : arguments) {
    const Eigen::Index left = points.rows() - 1;
    points = RowMatrix((1 - t) * points.topRows(left) + t * points.bottomRows(left));
  }
  return points.row(0).transpose();
}

/// The same polynomial in pieces: control point n of the piece from a to b is the polar form at a, ..., a, b, ..., b.
TargetTableData subdivided(const TargetTableData& data, const Eigen::VectorXd& knots) {
  TargetTableData pieces = data;
  pieces.knots = knots;
  pieces.control_points.resize((knots.size() - 1) * data.control_points.rows(), data.control_points.cols());
  Eigen::Index row = 0;
  for (Eigen::Index i = 0; i + 1 < knots.size(); ++i)
    for (Eigen::Index n = 0; n <= data.degree; ++n) {
      std::vector<double> arguments(static_cast<std::size_t>(data.degree), knots[i]);
      std::fill_n(arguments.begin(), n, knots[i + 1]);
      pieces.control_points.row(row++) = blossom(data, arguments).transpose();
    }
  return pieces;
}

const Eigen::VectorXd kKnots = (Eigen::VectorXd(8) << 0, 1e-3, 0.125, 0.126, 0.5, 0.75, 1 - 1e-6, 1).finished();

Eigen::Vector2d pair_at(double t) { return {1 - t, t}; }

class PiecesTest : public ::testing::TestWithParam<int> {
 protected:
  PiecesTest() : whole_(random_table({GetParam(), 2})), data_(subdivided(whole_, kKnots)), table_(data_) {}

  TargetTableData whole_, data_;
  TargetTable table_;
};

INSTANTIATE_TEST_SUITE_P(Degrees, PiecesTest, ::testing::Values(1, 2, 3, 5, 7, 12));

TEST_P(PiecesTest, OfOnePolynomialAreThatPolynomial) {
  const TargetTable whole(whole_);
  EXPECT_EQ(table_.pieces(), kKnots.size() - 1);
  for (std::uint32_t seed = 0; seed < 200; ++seed) {
    const Eigen::VectorXd w = random_weights(2, seed);
    EXPECT_LE((evaluate(table_, w) - evaluate(whole, w)).norm(), 1e-13) << w.transpose();
    // Rounding of the control points over the length of the shortest piece.
    EXPECT_LE((derivative(table_, w) - derivative(whole, w)).norm(), 1e-13 * GetParam() / 1e-6) << w.transpose();
  }
}

TEST_P(PiecesTest, AreThoseThatTheKnotsSay) {
  for (Eigen::Index i = 0; i + 1 < kKnots.size(); ++i) {
    EXPECT_EQ(table_.piece(pair_at(kKnots[i])), i);
    EXPECT_EQ(table_.piece(pair_at(std::nextafter(kKnots[i + 1], 0.0))), i);
  }
  EXPECT_EQ(table_.piece(pair_at(1)), kKnots.size() - 2);
  EXPECT_EQ(table_.piece(pair_at(-1e-17)), 0);
  EXPECT_EQ(table_.piece(pair_at(1 + 1e-15)), kKnots.size() - 2);
}

/// One with other control points in every piece, so that only what its own piece has can serve a weight.
TEST_P(PiecesTest, AreEvaluatedByThemselves) {
  data_.control_points = test::random_matrix(data_.control_points.rows(), kModes, 3);
  const TargetTable table(data_);
  for (Eigen::Index i = 0; i + 1 < kKnots.size(); ++i) {
    TargetTableData piece = whole_;
    piece.control_points = data_.control_points.middleRows(i * (GetParam() + 1), GetParam() + 1);
    const TargetTable alone(piece);
    const double length = kKnots[i + 1] - kKnots[i];
    for (const double s : {0.0, 0.2, 0.5, 0.99}) {
      const Eigen::Vector2d w = pair_at(kKnots[i] + s * length);
      const Eigen::Vector2d local = pair_at((w[1] - kKnots[i]) / length);
      EXPECT_LE((evaluate(table, w) - evaluate(alone, local)).norm(), 1e-14);
      const Eigen::MatrixXd jacobian = derivative(table, w), expected = derivative(alone, local);
      const Eigen::VectorXd slope = jacobian.col(1) - jacobian.col(0);
      EXPECT_LE((slope - (expected.col(1) - expected.col(0)) / length).norm(), 1e-12 * slope.norm());
      EXPECT_LE((jacobian * w).norm(), 1e-13 * slope.norm());
    }
  }
  EXPECT_EQ(evaluate(table, pair_at(0)), data_.control_points.row(0).transpose());
  EXPECT_EQ(evaluate(table, pair_at(1)), data_.control_points.bottomRows<1>().transpose());
}

TEST_P(PiecesTest, DoNotAllocate) {
  if (!test::AllocationCounter::works()) GTEST_SKIP() << "a sanitizer owns malloc";
  auto workspace = table_.make_workspace();
  Eigen::VectorXd target(kModes);
  Eigen::MatrixXd jacobian(kModes, 2);
  const Eigen::VectorXd w = random_weights(2, 1);
  std::size_t allocations = 0;
  {
    const test::AllocationCounter counter;
    table_.evaluate(w, workspace, target);
    table_.derivative(w, workspace, jacobian);
    allocations = counter.count();
  }
  EXPECT_EQ(allocations, 0U);
}

}  // namespace target_table_test
}  // namespace exmat::runtime
