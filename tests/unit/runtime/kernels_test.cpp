#include "runtime/kernels/kernels.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <cmath>
#include <gtest/gtest.h>
#include <limits>
#include <vector>

#include "common/elastic/st_venant_kirchhoff.h"
#include "runtime/sim/element_potential.h"
#include "tests/support/random.h"

namespace exmat::runtime {
namespace {

using Shape = std::pair<int, int>;  // r, s

constexpr InstructionSet kSets[] = {InstructionSet::kPortable, InstructionSet::kAvx2, InstructionSet::kAvx512};

std::vector<const Kernels*> available() {
  std::vector<const Kernels*> found;
  for (const InstructionSet set : kSets)
    if (const Kernels* kernels = kernels_for(set)) found.push_back(kernels);
  return found;
}

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
    isotropic.mu = mu.data();
    isotropic.lambda = lambda.data();
    shifted = isotropic;
    shifted.shift_count = shift_count;
    shifted.shifts = shifts.data();
    shifted.shift_weights = shift_weights.data();
    general.kind = ElementLaw::Kind::kQuadraticInGreenStrain;
    general.quadratic = quadratic.data();
    scratch_arrays = {AlignedArray(stride * kLanes), AlignedArray(9 * kLanes * stride), AlignedArray(stride * stride)};
    scratch = {scratch_arrays[0].data(), scratch_arrays[1].data(), scratch_arrays[2].data()};
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

  std::vector<const ElementLaw*> laws() const { return {&isotropic, &shifted, &general}; }

  Eigen::Index modes, elements;
  RowMatrix gradient;
  AlignedArray by_mode, by_element, mu, lambda, shifts, shift_weights, quadratic;
  ElementArrays arrays;
  ElementLaw isotropic, shifted, general;
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

TEST_P(KernelsTest, StVenantKirchhoffIsThatOfThePolicyElementByElement) {
  const Elements elements(GetParam());
  Values expected{0, Eigen::VectorXd::Zero(elements.modes), Eigen::MatrixXd::Zero(elements.modes, elements.modes)};
  for (Eigen::Index j = 0; j < elements.elements; ++j) {
    const Eigen::Matrix3d H = displacement_gradient(elements, j);
    const LameParameters lame{elements.mu[j], elements.lambda[j]};
    const auto B = elements.gradient.middleRows<9>(9 * j);
    const RowMatrix3 stress = StVenantKirchhoff::first_piola_kirchhoff(H, lame);
    expected.energy += StVenantKirchhoff::energy(H, lame);
    expected.force += B.transpose() * Eigen::Map<const Eigen::VectorXd>(stress.data(), 9);
    expected.stiffness += B.transpose() * StVenantKirchhoff::tangent(H, lame) * B;
  }
  for (const Kernels* kernels : available()) {
    const Values values = evaluate(*kernels, elements, elements.isotropic, elements.q);
    EXPECT_NEAR(values.energy, expected.energy, 1e-12 * std::abs(expected.energy)) << kernels->name;
    EXPECT_LE((values.force - expected.force).norm(), 1e-12 * expected.force.norm()) << kernels->name;
    const Eigen::MatrixXd lower = values.stiffness.triangularView<Eigen::Lower>();
    const Eigen::MatrixXd expected_lower = expected.stiffness.triangularView<Eigen::Lower>();
    EXPECT_LE((lower - expected_lower).norm(), 1e-12 * expected_lower.norm()) << kernels->name;
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
      // Energies are quartic and forces cubic along a line: five-point differences are exact but for rounding.
      const double h = 0.1;
      const auto moved = [&](double steps) { return Eigen::VectorXd(elements.q + steps * h * direction); };
      const auto energy = [&](double steps) { return kernels->energy(elements.arrays, *law, moved(steps).data()); };
      const double slope = (energy(-2) - 8 * energy(-1) + 8 * energy(1) - energy(2)) / (12 * h);
      const double scale = std::abs(energy(2)) + std::abs(energy(-2));
      EXPECT_NEAR(values.force.dot(direction), slope, 1e-12 * (scale / h + std::abs(slope))) << kernels->name;
      const Eigen::VectorXd difference =
          (force(*kernels, elements, *law, moved(-2)) - 8 * force(*kernels, elements, *law, moved(-1)) +
           8 * force(*kernels, elements, *law, moved(1)) - force(*kernels, elements, *law, moved(2))) /
          (12 * h);
      const double force_scale = force(*kernels, elements, *law, moved(2)).norm() + values.force.norm();
      EXPECT_LE((stiffness * direction - difference).norm(), 1e-12 * (force_scale / h + difference.norm()))
          << kernels->name;
    }
}

TEST_P(KernelsTest, NotANumberComesThrough) {
  Elements elements(GetParam());
  elements.q[elements.modes / 2] = std::numeric_limits<double>::quiet_NaN();
  for (const Kernels* kernels : available()) {
    const Values values = evaluate(*kernels, elements, elements.isotropic, elements.q);
    EXPECT_TRUE(std::isnan(values.energy) && std::isnan(values.force.sum())) << kernels->name;
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
