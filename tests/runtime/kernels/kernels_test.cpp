#include "runtime/kernels/kernels.h"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <gtest/gtest.h>
#include <limits>
#include <vector>

#include "common/core/decompositions.h"
#include "common/elastic/materials.h"
#include "runtime/sim/elasticity/element_potential.h"
#include "tests/support/instruction_sets.h"
#include "tests/support/random.h"

namespace exmat::runtime {
namespace {

using Shape = std::pair<int, int>;  // r, s

constexpr MaterialModel kModels[] = {MaterialModel::kStVenantKirchhoff, MaterialModel::kStableNeoHookean,
                                     MaterialModel::kCorotational};

/// Random elements in the two layouts, with the laws of them.
struct Elements {
  explicit Elements(Shape shape, Eigen::Index shift_count = 3) : modes(shape.first), elements(shape.second) {
    gradient =
        0.1 * Eigen::Map<const RowMatrix>(test::random_vector(9 * elements * modes, 1).data(), 9 * elements, modes);
    const Eigen::Index stride = padded(modes), panels = padded(elements) / kLanes;
    by_mode = AlignedArray(panels * modes * 9 * kLanes);
    by_element = AlignedArray(padded(elements) * 9 * stride);
    for (Eigen::Index j = 0; j < elements; ++j)
      for (Eigen::Index i = 0; i < 9; ++i)
        for (Eigen::Index c = 0; c < modes; ++c) {
          by_mode[((j / kLanes * modes + c) * 9 + i) * kLanes + j % kLanes] = gradient(9 * j + i, c);
          by_element[(9 * j + i) * stride + c] = gradient(9 * j + i, c);
        }
    arrays = {panels, modes, stride, by_mode.data(), by_element.data()};
    mu = random_panels(1, 2);
    lambda = random_panels(1, 3);
    shifts = random_panels(shift_count * 9, 4);
    shift_weights = AlignedArray(shift_count);
    for (Eigen::Index k = 0; k < shift_count; ++k) shift_weights[k] = 0.2 + 0.1 * static_cast<double>(k);
    quadratic = random_panels(kQuadraticNumbers, 5);
    inverses = random_panels(shift_count * kInverseNumbers, 6);
    for (std::ptrdiff_t i = 0; i < inverses.size(); ++i) {
      const std::ptrdiff_t number = i / kLanes % kInverseNumbers;
      inverses[i] = number % 4 == 0 || number == 9 ? 1 + 0.3 * inverses[i] : 0.3 * inverses[i];
    }
    for (std::size_t m = 0; m < std::size(kModels); ++m) {
      ElementLaw& law = materials[m];
      law.kind = law_kind(kModels[m]);
      law.mu = mu.data();
      law.lambda = lambda.data();
      shifted[m] = law;
      shifted[m].shift_count = shift_count;
      shifted[m].shifts = shifts.data();
      shifted[m].shift_weights = shift_weights.data();
      referred[m] = shifted[m];
      referred[m].inverses = inverses.data();
    }
    general.kind = ElementLaw::Kind::kQuadraticInGreenStrain;
    general.quadratic = quadratic.data();
    scratch_arrays = {AlignedArray(stride * kLanes), AlignedArray(lane_triangle(modes) / kLanes)};
    scratch = {scratch_arrays[0].data(), scratch_arrays[1].data()};
    q = test::random_vector(modes, 7);
  }

  /// Zero for the elements that pad the last panel.
  AlignedArray random_panels(Eigen::Index numbers, std::uint32_t seed) const {
    const Eigen::Index panels = padded(elements) / kLanes;
    const Eigen::VectorXd values = test::random_vector(panels * numbers * kLanes, seed);
    AlignedArray array(values.size());
    for (Eigen::Index i = 0; i < values.size(); ++i) {
      const Eigen::Index element = i / (numbers * kLanes) * kLanes + i % kLanes;
      if (element < elements) array[i] = values[i];
    }
    return array;
  }

  std::vector<const ElementLaw*> laws() const {
    std::vector<const ElementLaw*> all{&general};
    for (std::size_t m = 0; m < std::size(kModels); ++m)
      all.insert(all.end(), {&materials[m], &shifted[m], &referred[m]});
    return all;
  }

  Eigen::Index modes, elements;
  RowMatrix gradient;
  AlignedArray by_mode, by_element, mu, lambda, shifts, shift_weights, inverses, quadratic;
  ElementArrays arrays;
  std::array<ElementLaw, std::size(kModels)> materials, shifted, referred;
  ElementLaw general;
  std::vector<AlignedArray> scratch_arrays;
  ElementScratch scratch;
  Eigen::VectorXd q;
};

struct Values {
  double energy = 0;
  Eigen::VectorXd force;
  Eigen::MatrixXd stiffness;
};

Values evaluate(const Kernels& kernels, const Elements& elements, const ElementLaw& law, const Eigen::VectorXd& q) {
  Values values{0, Eigen::VectorXd::Zero(q.size()), Eigen::MatrixXd::Zero(q.size(), q.size())};
  values.energy = kernels.force_and_stiffness(elements.arrays, law, q.data(), elements.scratch, values.force.data(),
                                              values.stiffness.data(), q.size());
  return values;
}

Eigen::VectorXd force(const Kernels& kernels, const Elements& elements, const ElementLaw& law,
                      const Eigen::VectorXd& q) {
  Eigen::VectorXd force(q.size());
  kernels.force(elements.arrays, law, q.data(), elements.scratch, force.data());
  return force;
}

Eigen::Matrix3d displacement_gradient(const Elements& elements, Eigen::Index j) {
  const Eigen::VectorXd H = elements.gradient.middleRows<9>(9 * j) * elements.q;
  return H.reshaped<Eigen::RowMajor>(3, 3);
}

class KernelsTest : public ::testing::TestWithParam<Shape> {};

// Sizes below, at and above one panel of elements and one register of modes, those of the paper's scenes among them.
INSTANTIATE_TEST_SUITE_P(Sizes, KernelsTest,
                         ::testing::Values(Shape{1, 1}, Shape{3, 7}, Shape{8, 8}, Shape{13, 9}, Shape{20, 23},
                                           Shape{30, 60}, Shape{42, 21}, Shape{65, 16}),
                         [](const auto& test) {
                           return "r" + std::to_string(test.param.first) + "s" + std::to_string(test.param.second);
                         });

/// Energy, force and stiffness of one example of a law or of the law itself, by the struct of the material.
template <class Material>
void add_element(const Elements& elements, const ElementLaw& law, Eigen::Index j, Eigen::Index k, Values& sum) {
  const auto number = [&](const double* from, Eigen::Index count, Eigen::Index i) {
    return from[((j / kLanes * law.shift_count + k) * count + i) * kLanes + j % kLanes];
  };
  Eigen::Matrix3d H = displacement_gradient(elements, j), A = Eigen::Matrix3d::Identity();
  double weight = 1;
  if (law.shift_count > 0) {
    weight = law.shift_weights[k] * (law.inverses == nullptr ? 1 : number(law.inverses, kInverseNumbers, 9));
    for (int i = 0; i < 9; ++i) {
      H(i / 3, i % 3) -= number(law.shifts, 9, i);
      if (law.inverses != nullptr) A(i / 3, i % 3) = number(law.inverses, kInverseNumbers, i);
    }
  }
  const LameParameters lame{weight * elements.mu[j], weight * elements.lambda[j]};
  // d(H A) / dH for rows 3a + b.
  Eigen::Matrix<double, 9, 9> by_H = Eigen::Matrix<double, 9, 9>::Zero();
  for (int a = 0; a < 3; ++a) by_H.block<3, 3>(3 * a, 3 * a) = A.transpose();
  const Eigen::MatrixXd B = by_H * elements.gradient.middleRows<9>(9 * j);
  const RowMatrix3 stress = Material::first_piola_kirchhoff(H * A, lame);
  sum.energy += Material::energy(H * A, lame);
  sum.force += B.transpose() * Eigen::Map<const Eigen::VectorXd>(stress.data(), 9);
  sum.stiffness += B.transpose() * Material::tangent(H * A, lame) * B;
}

// The lanes of the corotational material find its rotation by another method.
TEST_P(KernelsTest, MaterialsAreThoseOfTheirStructsElementByElement) {
  const Elements elements(GetParam());
  for (std::size_t m = 0; m < std::size(kModels); ++m)
    for (const ElementLaw* law : {&elements.materials[m], &elements.shifted[m], &elements.referred[m]}) {
      Values expected{0, Eigen::VectorXd::Zero(elements.modes), Eigen::MatrixXd::Zero(elements.modes, elements.modes)};
      for (Eigen::Index j = 0; j < elements.elements; ++j)
        for (Eigen::Index k = 0; k < std::max<Eigen::Index>(1, law->shift_count); ++k)
          with_material(kModels[m], [&](auto own) { add_element<decltype(own)>(elements, *law, j, k, expected); });
      const Eigen::MatrixXd expected_lower = expected.stiffness.triangularView<Eigen::Lower>();
      for (const Kernels* kernels : available()) {
        const Values values = evaluate(*kernels, elements, *law, elements.q);
        EXPECT_NEAR(values.energy, expected.energy, 1e-11 * std::abs(expected.energy)) << kernels->name << m;
        EXPECT_LE((values.force - expected.force).norm(), 1e-11 * expected.force.norm()) << kernels->name << m;
        const Eigen::MatrixXd lower = values.stiffness.triangularView<Eigen::Lower>();
        EXPECT_LE((lower - expected_lower).norm(), 1e-11 * expected_lower.norm()) << kernels->name << m;
      }
    }
}

TEST_P(KernelsTest, EveryInstructionSetAgreesWithThePortableOne) {
  const Elements elements(GetParam());
  for (const ElementLaw* law : elements.laws()) {
    const Values expected = evaluate(*kernels_for(InstructionSet::kPortable), elements, *law, elements.q);
    for (const Kernels* kernels : available()) {
      const Values values = evaluate(*kernels, elements, *law, elements.q);
      EXPECT_NEAR(values.energy, expected.energy, 1e-12 * std::abs(expected.energy)) << kernels->name;
      EXPECT_LE((values.force - expected.force).norm(), 1e-12 * expected.force.norm()) << kernels->name;
      EXPECT_LE((values.stiffness - expected.stiffness).norm(), 1e-12 * expected.stiffness.norm()) << kernels->name;
      EXPECT_NEAR(kernels->energy(elements.arrays, *law, elements.q.data()), values.energy,
                  1e-13 * std::abs(values.energy));
      EXPECT_LE((force(*kernels, elements, *law, elements.q) - values.force).norm(), 1e-13 * values.force.norm());
      AlignedArray tangents(elements.arrays.panels * kTangentNumbers * kLanes);
      kernels->tangents(elements.arrays, *law, elements.q.data(), tangents.data());
      Eigen::MatrixXd stiffness = Eigen::MatrixXd::Zero(elements.modes, elements.modes);
      kernels->stiffness_of_tangents(elements.arrays, tangents.data(), elements.scratch, stiffness.data(),
                                     elements.modes);
      EXPECT_LE((stiffness - values.stiffness).norm(), 1e-13 * values.stiffness.norm()) << kernels->name;
    }
  }
}

TEST_P(KernelsTest, ForceAndStiffnessAreDerivatives) {
  const Elements elements(GetParam());
  const Eigen::Index modes = elements.modes;
  for (const ElementLaw* law : elements.laws())
    for (const Kernels* kernels : available()) {
      const Values values = evaluate(*kernels, elements, *law, elements.q);
      const Eigen::MatrixXd stiffness = values.stiffness.selfadjointView<Eigen::Lower>();
      const Eigen::VectorXd direction = test::random_vector(modes, 11);
      // In the Green strain energies are quartic and forces cubic along a line: five-point differences are exact but
      // for rounding. Others err by h^4.
      const bool polynomial = law->kind == ElementLaw::Kind::kStVenantKirchhoff || law == &elements.general;
      const double h = polynomial ? 0.1 : 1e-3, error = polynomial ? 0 : 1e-8;
      const auto moved = [&](double steps) { return Eigen::VectorXd(elements.q + steps * h * direction); };
      const auto energy = [&](double steps) { return kernels->energy(elements.arrays, *law, moved(steps).data()); };
      const double slope = (energy(-2) - 8 * energy(-1) + 8 * energy(1) - energy(2)) / (12 * h);
      const double scale = std::abs(energy(2)) + std::abs(energy(-2));
      EXPECT_NEAR(values.force.dot(direction), slope,
                  1e-12 * (scale / h + std::abs(slope)) + error * values.force.norm())
          << kernels->name;
      const Eigen::VectorXd difference =
          (force(*kernels, elements, *law, moved(-2)) - 8 * force(*kernels, elements, *law, moved(-1)) +
           8 * force(*kernels, elements, *law, moved(1)) - force(*kernels, elements, *law, moved(2))) /
          (12 * h);
      const double force_scale = force(*kernels, elements, *law, moved(2)).norm() + values.force.norm();
      EXPECT_LE((stiffness * direction - difference).norm(),
                1e-12 * (force_scale / h + difference.norm()) + error * stiffness.norm())
          << kernels->name;
    }
}

TEST_P(KernelsTest, NotANumberComesThrough) {
  Elements elements(GetParam());
  elements.q[elements.modes / 2] = std::numeric_limits<double>::quiet_NaN();
  for (const Kernels* kernels : available()) {
    for (const ElementLaw* law : elements.laws()) {
      const Values values = evaluate(*kernels, elements, *law, elements.q);
      EXPECT_TRUE(std::isnan(values.energy) && std::isnan(values.force.sum())) << kernels->name;
    }
  }
}

/// One panel of elements whose displacement gradients are the coordinates.
struct Panel {
  Panel() {
    for (int j = 0; j < kLanes; ++j)
      for (int i = 0; i < 9; ++i) by_mode[((9 * j + i) * 9 + i) * kLanes + j] = 1;
    for (int j = 0; j < kLanes; ++j) mu[j] = 1;
    law.kind = ElementLaw::Kind::kCorotational;
    law.mu = mu.data();
    law.lambda = lambda.data();
  }

  Eigen::VectorXd coordinates(const std::array<Eigen::Matrix3d, kLanes>& F) const {
    Eigen::VectorXd q(9 * kLanes);
    for (int j = 0; j < kLanes; ++j)
      q.segment<9>(9 * j) = (F[j] - Eigen::Matrix3d::Identity()).reshaped<Eigen::RowMajor>();
    return q;
  }

  /// mu = 1 and lambda = 0: P = 2 (F - R).
  std::array<Eigen::Matrix3d, kLanes> rotations(const Kernels& kernels, const Eigen::VectorXd& q) {
    Eigen::VectorXd force(9 * kLanes);
    AlignedArray scratch_force(9 * kLanes * kLanes);
    kernels.force(arrays, law, q.data(), {scratch_force.data(), nullptr}, force.data());
    std::array<Eigen::Matrix3d, kLanes> found;
    for (int j = 0; j < kLanes; ++j)
      found[j] = Eigen::Matrix3d::Identity() + (q - 0.5 * force).segment<9>(9 * j).reshaped<Eigen::RowMajor>(3, 3);
    return found;
  }

  AlignedArray by_mode{9 * kLanes * 9 * kLanes}, mu{kLanes}, lambda{kLanes};
  ElementArrays arrays{1, 9 * kLanes, 9 * kLanes, by_mode.data(), nullptr};
  ElementLaw law;
};

Eigen::Matrix3d random_rotation(std::uint32_t seed) {
  const Eigen::VectorXd random = test::random_vector(4, seed);
  return Eigen::Quaterniond(random[0], random[1], random[2], random[3]).normalized().toRotationMatrix();
}

// Against U V^T of the F = U S V^T that it is made of. Rounding is amplified by |F| over the least sum of two
// stretches.
TEST(NearestRotationTest, IsThatOfTheSingularVectors) {
  Panel panel;
  const Eigen::Vector3d cases[] = {{1, 1, 1},       {1.3, 1, 0.8},    {2, 0.5, 0.1},    {1, 1, -0.5},
                                   {1, 0.5, -0.45}, {1, 0.5, -0.499}, {1, 1, -0.999},   {1, 0.5, -0.4998},
                                   {1, 1e-3, 1e-4}, {100, 1, 0.05},   {1e3, 1e3, -900}, {1e-6, 1e-6, 1e-6}};
  for (const Eigen::Vector3d& s : cases)
    for (std::uint32_t seed = 0; seed < 25; ++seed) {
      std::array<Eigen::Matrix3d, kLanes> F, expected;
      for (int j = 0; j < kLanes; ++j) {
        const auto number = static_cast<std::uint32_t>(j);
        const Eigen::Matrix3d U = random_rotation(16 * seed + number), V = random_rotation(16 * seed + 8 + number);
        F[j] = U * s.asDiagonal() * V.transpose();
        expected[j] = U * V.transpose();
      }
      const Eigen::VectorXd q = panel.coordinates(F);
      for (const Kernels* kernels : available()) {
        const auto found = panel.rotations(*kernels, q);
        const double amplified = 1e-15 * (1 + s.norm()) * (1 + 1 / s.norm() + s.norm() / (s[1] + s[2]));
        for (int j = 0; j < kLanes; ++j) EXPECT_LE((found[j] - expected[j]).norm(), 20 * amplified) << s.transpose();
      }
    }
}

// The rotation is not unique where two stretches add up to nothing: it is one, and of nearly the largest trace.
TEST(NearestRotationTest, IsARotationOfLargestTraceWhereItIsNotUnique) {
  Panel panel;
  const Eigen::Vector3d cases[] = {{1, 1, -1},       {1, 0, 0},   {1, 0.5, -0.5},       {0, 0, 0},
                                   {1, 1e-7, -1e-8}, {1e3, 0, 0}, {1, 0.5, -0.4999999}, {1, 1, -0.99999}};
  for (const Eigen::Vector3d& s : cases)
    for (std::uint32_t seed = 0; seed < 25; ++seed) {
      std::array<Eigen::Matrix3d, kLanes> F;
      for (int j = 0; j < kLanes; ++j) {
        const auto number = static_cast<std::uint32_t>(j);
        F[j] =
            random_rotation(16 * seed + number) * s.asDiagonal() * random_rotation(16 * seed + 8 + number).transpose();
      }
      const Eigen::VectorXd q = panel.coordinates(F);
      for (const Kernels* kernels : available()) {
        const auto found = panel.rotations(*kernels, q);
        for (int j = 0; j < kLanes; ++j) {
          const Eigen::Matrix3d& R = found[j];
          EXPECT_LE((R.transpose() * R - Eigen::Matrix3d::Identity()).norm(), 1e-14 * (1 + s.norm()));
          EXPECT_GT(R.determinant(), 0);
          EXPECT_GE((R.transpose() * F[j]).trace(), s.sum() - 1e-4 * s.norm()) << s.transpose();
        }
        // And the stiffness there is finite.
        AlignedArray tangents(kTangentNumbers * kLanes);
        kernels->tangents(panel.arrays, panel.law, q.data(), tangents.data());
        for (std::ptrdiff_t i = 0; i < tangents.size(); ++i) ASSERT_TRUE(std::isfinite(tangents[i])) << s.transpose();
      }
    }
}

// Psi of strains far below rounding of F, with their digits: linear elasticity.
TEST(NearestRotationTest, SmallStrainsKeepTheirDigits) {
  Panel panel;
  for (int j = 0; j < kLanes; ++j) panel.lambda[j] = 2;
  for (const MaterialModel model : kModels) {
    panel.law.kind = law_kind(model);
    const Eigen::VectorXd q = 1e-11 * test::random_vector(9 * kLanes, 3);
    double expected = 0;
    for (int j = 0; j < kLanes; ++j) {
      const Eigen::Matrix3d H = q.segment<9>(9 * j).reshaped<Eigen::RowMajor>(3, 3), e = 0.5 * (H + H.transpose());
      expected += e.squaredNorm() + e.trace() * e.trace();
    }
    for (const Kernels* kernels : available())
      EXPECT_NEAR(kernels->energy(panel.arrays, panel.law, q.data()), expected, 1e-9 * expected) << kernels->name;
  }
}

TEST_P(KernelsTest, SymmetricProductIsThatOfTheDenseMatrix) {
  const Eigen::Index blocks = padded(GetParam().first) / kLanes, size = blocks * kLanes;
  const Eigen::MatrixXd square =
      Eigen::Map<const Eigen::MatrixXd>(test::random_vector(size * size, 3).data(), size, size);
  const Eigen::MatrixXd D = square + square.transpose();
  AlignedArray packed(blocks * (blocks + 1) / 2 * kLanes * kLanes), product(size);
  double* out = packed.data();
  for (Eigen::Index column = 0; column < blocks; ++column)
    for (Eigen::Index row = column; row < blocks; ++row, out += kLanes * kLanes)
      Eigen::Map<Eigen::MatrixXd>(out, kLanes, kLanes) = D.block(row * kLanes, column * kLanes, kLanes, kLanes);
  const Eigen::VectorXd y = test::random_vector(size, 4);
  for (const Kernels* kernels : available()) {
    kernels->symmetric_product(packed.data(), blocks, y.data(), product.data());
    EXPECT_LE((Eigen::Map<Eigen::VectorXd>(product.data(), size) - D * y).norm(), 1e-14 * D.norm() * y.norm());
  }
}

TEST_P(KernelsTest, MatrixVectorIsThatOfTheDenseMatrix) {
  const Eigen::Index columns = GetParam().first, rows = padded(GetParam().second);
  const Eigen::MatrixXd A =
      Eigen::Map<const Eigen::MatrixXd>(test::random_vector(rows * columns, 5).data(), rows, columns);
  const Eigen::VectorXd x = test::random_vector(columns, 6);
  for (const Kernels* kernels : available()) {
    Eigen::VectorXd y(rows);
    kernels->matrix_vector(A.data(), rows, columns, rows, x.data(), y.data());
    EXPECT_LE((y - A * x).norm(), 1e-14 * A.norm() * x.norm()) << kernels->name;
  }
}

TEST_P(KernelsTest, CholeskySolvesAndRefusesWhatIsNotPositive) {
  const Eigen::Index size = GetParam().first;
  const Eigen::MatrixXd square =
      Eigen::Map<const Eigen::MatrixXd>(test::random_vector(size * size, 8).data(), size, size);
  Eigen::MatrixXd A = square * square.transpose() + 0.1 * Eigen::MatrixXd::Identity(size, size);
  const Eigen::VectorXd right = test::random_vector(size, 9);
  const Eigen::MatrixXd expected = A.llt().matrixL();
  Eigen::MatrixXd lower = A;
  lower.triangularView<Eigen::StrictlyUpper>().setConstant(std::numeric_limits<double>::quiet_NaN());
  for (const Kernels* kernels : available()) {
    AlignedArray L(size * padded(size)), x(size);
    ASSERT_TRUE(kernels->cholesky(lower.data(), size, size, L.data())) << kernels->name;
    for (Eigen::Index j = 0; j < size; ++j)
      for (Eigen::Index i = j; i < size; ++i)
        EXPECT_NEAR(L[j * padded(size) + i], i == j ? 1 / expected(i, i) : expected(i, j),
                    1e-12 * expected.norm() * (i == j ? 1 / expected(i, i) : 1));
    for (Eigen::Index i = 0; i < size; ++i) x[i] = right[i];
    kernels->cholesky_solve(L.data(), size, x.data());
    const Eigen::Map<const Eigen::VectorXd> solution(x.data(), size);
    EXPECT_LE((A * solution - right).norm(), 1e-14 * A.norm() * solution.norm()) << kernels->name;

    Eigen::MatrixXd indefinite = A;
    indefinite(size - 1, size - 1) = -1;
    EXPECT_FALSE(kernels->cholesky(indefinite.data(), size, size, L.data())) << kernels->name;
    indefinite(size - 1, size - 1) = std::numeric_limits<double>::quiet_NaN();
    EXPECT_FALSE(kernels->cholesky(indefinite.data(), size, size, L.data())) << kernels->name;
  }
}

TEST(KernelsTest, GemmIsTheProduct) {
  const Eigen::Index n = 2 * kGemmMultiple;
  const Eigen::MatrixXd A = Eigen::Map<const Eigen::MatrixXd>(test::random_vector(n * n, 1).data(), n, n);
  const Eigen::MatrixXd B = Eigen::Map<const Eigen::MatrixXd>(test::random_vector(n * n, 2).data(), n, n);
  AlignedArray packed_a(n * n), packed_b(n * n);
  for (Eigen::Index k = 0; k < n; ++k)
    for (Eigen::Index i = 0; i < n; ++i) {
      packed_a[(i / kLanes * n + k) * kLanes + i % kLanes] = A(k, i);
      packed_b[(i / kGemmMultiple * n + k) * kGemmMultiple + i % kGemmMultiple] = B(k, i);
    }
  for (const Kernels* kernels : available()) {
    AlignedArray C(n * n);
    kernels->gemm(n, packed_a.data(), packed_b.data(), C.data());
    const RowMatrix product = Eigen::Map<const RowMatrix>(C.data(), n, n);
    EXPECT_LE((product - A.transpose() * B).norm(), 1e-14 * A.norm() * B.norm()) << kernels->name;
  }
}

TEST(KernelsTest, TheSetInUseIsOneOfTheMachine) {
  bool found = false;
  for (const Kernels* candidate : available()) found = found || candidate == &kernels();
  EXPECT_TRUE(found);
}

}  // namespace
}  // namespace exmat::runtime
