#include "common/elastic/materials.h"

#include <Eigen/Geometry>
#include <cmath>
#include <gtest/gtest.h>

#include "common/core/decompositions.h"
#include "tests/support/random.h"

namespace exmat {
namespace {

constexpr LameParameters kLame{3.0, 7.0};
const Eigen::Matrix3d kIdentity = Eigen::Matrix3d::Identity();

Eigen::Matrix3d random_matrix(std::uint32_t seed, double size) { return size * test::random_matrix(3, 3, seed); }

Eigen::Matrix3d random_rotation(std::uint32_t seed) {
  const Eigen::VectorXd random = test::random_vector(4, seed);
  return Eigen::Quaterniond(random[0], random[1], random[2], random[3]).normalized().toRotationMatrix();
}

double dot(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b) { return a.cwiseProduct(b).sum(); }

Eigen::Matrix<double, 9, 1> flatten(const Eigen::Matrix3d& matrix) { return matrix.reshaped<Eigen::RowMajor>(); }

/// Displacement gradients of upright and of inverted elements, no principal stretches near the kink of corotational.
std::vector<Eigen::Matrix3d> gradients() {
  std::vector<Eigen::Matrix3d> found;
  for (std::uint32_t seed = 0; found.size() < 30; ++seed) {
    const Eigen::Matrix3d H = random_matrix(seed, seed % 3 == 0 ? 1.5 : 0.7);
    const Eigen::Vector3d s = signed_svd(kIdentity + H).stretches;
    if (s[1] + s[2] > 0.2) found.push_back(H);
  }
  return found;
}

// Energy by the definitions, term by term, from singular values alone.
template <typename Material>
double defined_energy(const Eigen::Matrix3d& F, const LameParameters& lame) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(F);
  Eigen::Vector3d s = svd.singularValues();
  if (F.determinant() < 0) s[2] *= -1;
  if constexpr (std::is_same_v<Material, StVenantKirchhoff>) {
    const Eigen::Vector3d strain = 0.5 * (s.array().square() - 1);
    return lame.mu * strain.squaredNorm() + 0.5 * lame.lambda * strain.sum() * strain.sum();
  } else if constexpr (std::is_same_v<Material, Corotational>) {
    const Eigen::Vector3d strain = s.array() - 1;
    return lame.mu * strain.squaredNorm() + 0.5 * lame.lambda * strain.sum() * strain.sum();
  } else {
    const double mu = 4 * lame.mu / 3, lambda = lame.lambda + 5 * lame.mu / 6;
    const double alpha = 1 + mu / lambda - mu / 4 / lambda, invariant = s.squaredNorm();
    const auto psi = [&](double square, double volume) {
      return mu / 2 * (square - 3) + lambda / 2 * (volume - alpha) * (volume - alpha) - mu / 2 * std::log(square + 1);
    };
    return psi(invariant, s.prod()) - psi(3, 1);
  }
}

template <typename Material>
class MaterialTest : public ::testing::Test {};

struct Names {
  template <typename Material>
  static std::string GetName(int) {
    for (const auto model :
         {MaterialModel::kStVenantKirchhoff, MaterialModel::kStableNeoHookean, MaterialModel::kCorotational})
      if (with_material(model, [](auto material) { return std::is_same_v<decltype(material), Material>; }))
        return std::string(name_of(model));
    return "";
  }
};
using AllMaterials = ::testing::Types<StVenantKirchhoff, StableNeoHookean, Corotational>;
TYPED_TEST_SUITE(MaterialTest, AllMaterials, Names);

TYPED_TEST(MaterialTest, EnergyIsThatOfItsDefinition) {
  for (const Eigen::Matrix3d& H : gradients()) {
    const double expected = defined_energy<TypeParam>(kIdentity + H, kLame);
    EXPECT_NEAR(TypeParam::energy(H, kLame), expected, 1e-12 * (1 + expected));
  }
}

// Central differences of step h err by h^2 f'''/6 and by rounding / h: half the step, a quarter of the error.
TYPED_TEST(MaterialTest, StressIsTheGradientOfTheEnergyToSecondOrder) {
  for (const Eigen::Matrix3d& H : gradients()) {
    const Eigen::Matrix3d D = random_matrix(77, 1);
    const double slope = dot(TypeParam::first_piola_kirchhoff(H, kLame), D);
    const auto error = [&](double h) {
      return std::abs((TypeParam::energy(H + h * D, kLame) - TypeParam::energy(H - h * D, kLame)) / (2 * h) - slope);
    };
    EXPECT_LE(error(1e-5), 1e-7 * (1 + std::abs(slope)));
    if (error(2e-3) > 1e-6) {
      EXPECT_NEAR(error(2e-3) / error(1e-3), 4, 0.2);
    }
  }
}

TYPED_TEST(MaterialTest, TangentIsTheGradientOfTheStressToSecondOrder) {
  for (const Eigen::Matrix3d& H : gradients()) {
    const Eigen::Matrix3d D = random_matrix(78, 1);
    const Matrix9 tangent = TypeParam::tangent(H, kLame);
    const Eigen::Matrix<double, 9, 1> change = tangent * flatten(D);
    const auto error = [&](double h) {
      const Eigen::Matrix3d difference =
          (TypeParam::first_piola_kirchhoff(H + h * D, kLame) - TypeParam::first_piola_kirchhoff(H - h * D, kLame)) /
          (2 * h);
      return (flatten(difference) - change).norm();
    };
    EXPECT_LE(error(1e-5), 1e-6 * (1 + tangent.norm()));
    EXPECT_LE((tangent - tangent.transpose()).norm(), 1e-13 * tangent.norm());
    if (error(2e-3) > 1e-6) {
      EXPECT_NEAR(error(2e-3) / error(1e-3), 4, 0.3);
    }
  }
}

// The mixed difference errs by h^2.
TYPED_TEST(MaterialTest, RestSecondDerivativeIsTheMixedDifferenceOfTheStress) {
  for (std::uint32_t seed = 0; seed < 10; ++seed) {
    const Eigen::Matrix3d A = random_matrix(seed, 1), B = random_matrix(seed + 100, 1);
    const auto P = [](const Eigen::Matrix3d& H) { return TypeParam::first_piola_kirchhoff(H, kLame); };
    const auto mixed = [&](double h) -> Eigen::Matrix3d {
      return (P(h * (A + B)) - P(h * (A - B)) - P(h * (B - A)) + P(h * (-A - B))) / (4 * h * h);
    };
    const Eigen::Matrix3d derivative = TypeParam::rest_second_derivative(A, B, kLame);
    const auto error = [&](double h) { return (mixed(h) - derivative).norm(); };
    EXPECT_LE(error(1e-4), 1e-6 * derivative.norm());
    EXPECT_LE((derivative - TypeParam::rest_second_derivative(B, A, kLame)).norm(), 1e-14 * derivative.norm());
    if (error(2e-2) > 1e-9 * derivative.norm()) {
      EXPECT_NEAR(error(2e-2) / error(1e-2), 4, 0.3);
    }
  }
}

TYPED_TEST(MaterialTest, RestIsFreeOfStressAndStiffAsLinearElasticity) {
  for (const double poisson_ratio : {-0.3, 0.0, 0.3, 0.499}) {
    const LameParameters lame = lame_parameters(1e5, poisson_ratio);
    const Eigen::Matrix3d rest = Eigen::Matrix3d::Zero();
    EXPECT_EQ(TypeParam::energy(rest, lame), 0);
    EXPECT_EQ(TypeParam::first_piola_kirchhoff(rest, lame).norm(), 0);
    const Matrix9 tangent = TypeParam::tangent(rest, lame);
    for (std::uint32_t seed = 0; seed < 5; ++seed) {
      const Eigen::Matrix3d H = random_matrix(seed, 1);
      const Eigen::Matrix3d linear = lame.mu * (H + H.transpose()) + lame.lambda * H.trace() * kIdentity;
      EXPECT_LE((tangent * flatten(H) - flatten(linear)).norm(), 1e-13 * tangent.norm() * H.norm());
    }
  }
}

TYPED_TEST(MaterialTest, RotationsBeforeAndAfterAreNotSeen) {
  std::uint32_t seed = 0;
  for (const Eigen::Matrix3d& H : gradients()) {
    const Eigen::Matrix3d R = random_rotation(++seed);
    const double energy = TypeParam::energy(H, kLame);
    EXPECT_NEAR(TypeParam::energy(R * (kIdentity + H) - kIdentity, kLame), energy, 1e-12 * (1 + energy));
    EXPECT_NEAR(TypeParam::energy((kIdentity + H) * R - kIdentity, kLame), energy, 1e-12 * (1 + energy));
    const Eigen::Matrix3d turned = TypeParam::first_piola_kirchhoff(R * (kIdentity + H) - kIdentity, kLame);
    EXPECT_LE((turned - R * TypeParam::first_piola_kirchhoff(H, kLame)).norm(), 1e-12 * (1 + turned.norm()));
    EXPECT_LE(TypeParam::first_piola_kirchhoff(R - kIdentity, kLame).norm(), 1e-13);
    EXPECT_LE(TypeParam::energy(R - kIdentity, kLame), 1e-27);
  }
}

TYPED_TEST(MaterialTest, SmallStrainsKeepTheirDigits) {
  const Eigen::Matrix3d H = 1e-12 * random_matrix(5, 1), e = 0.5 * (H + H.transpose());
  const double energy = kLame.mu * e.squaredNorm() + 0.5 * kLame.lambda * e.trace() * e.trace();
  EXPECT_NEAR(TypeParam::energy(H, kLame), energy, 1e-10 * energy);
  const Eigen::Matrix3d stress = 2 * kLame.mu * e + kLame.lambda * e.trace() * kIdentity;
  EXPECT_LE((TypeParam::first_piola_kirchhoff(H, kLame) - stress).norm(), 1e-10 * stress.norm());
}

/// Distance of the tangent from that of its modes.
TYPED_TEST(MaterialTest, EigensystemIsThatOfTheTangent) {
  for (const Eigen::Matrix3d& H : gradients()) {
    const Matrix9 tangent = TypeParam::tangent(H, kLame);
    const SignedSvd svd = signed_svd(kIdentity + H);
    EXPECT_LE((svd.U * svd.stretches.asDiagonal() * svd.V.transpose() - kIdentity - H).norm(), 1e-14 * (1 + H.norm()));
    const PrincipalTangent principal = TypeParam::principal_tangent(svd.stretches, kLame);
    EXPECT_LE((tangent_of(principal, svd) - tangent).norm(), 1e-12 * tangent.norm());
    Eigen::VectorXd expected(9);
    expected << Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(principal.stretch).eigenvalues(), principal.twist,
        principal.flip;
    std::sort(expected.begin(), expected.end());
    // The tangent by differences of the stress alone.
    Eigen::Matrix<double, 9, 9> difference;
    for (int i = 0; i < 9; ++i) {
      Eigen::Matrix3d D = Eigen::Matrix3d::Zero();
      D(i / 3, i % 3) = 1e-5;
      difference.col(i) =
          flatten(TypeParam::first_piola_kirchhoff(H + D, kLame) - TypeParam::first_piola_kirchhoff(H - D, kLame)) /
          2e-5;
    }
    const Eigen::Matrix<double, 9, 9> symmetric = 0.5 * (difference + difference.transpose());
    const Eigen::VectorXd found = Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 9, 9>>(symmetric).eigenvalues();
    EXPECT_LE((found - expected).norm(), 1e-7 * expected.norm());
  }
}

TYPED_TEST(MaterialTest, ProjectionClampsTheEigenvalues) {
  int indefinite = 0;
  for (const Eigen::Matrix3d& H : gradients()) {
    const Matrix9 tangent = TypeParam::tangent(H, kLame);
    const Matrix9 projected = projected_tangent<TypeParam>(H, kLame);
    EXPECT_LE((projected - project_positive_semidefinite(tangent)).norm(), 1e-11 * tangent.norm());
    if ((projected - tangent).norm() > 1e-3 * tangent.norm()) ++indefinite;
  }
  EXPECT_GE(indefinite, 3);
}

// Cauchy stress along the axis over the stretch, by Psi of the principal stretches (s, t, t), t free of stress.
TYPED_TEST(MaterialTest, UniaxialStretchHasTheAnalyticStress) {
  for (const double s : {0.7, 0.9, 1.2, 1.8}) {
    const LameParameters lame{3.0, 0.0};  // nu = 0
    Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
    H(0, 0) = s - 1;
    const double stress = TypeParam::first_piola_kirchhoff(H, lame)(0, 0);
    double expected = 0;
    if constexpr (std::is_same_v<TypeParam, StVenantKirchhoff>) expected = lame.mu * s * (s * s - 1);
    if constexpr (std::is_same_v<TypeParam, Corotational>) expected = 2 * lame.mu * (s - 1);
    if constexpr (std::is_same_v<TypeParam, StableNeoHookean>) {
      const double mu = 4 * lame.mu / 3, lambda = 5 * lame.mu / 6, alpha = 1 + 0.75 * mu / lambda;
      expected = mu * s * (1 - 1 / (s * s + 3)) + lambda * (s - alpha);
    }
    EXPECT_NEAR(stress, expected, 1e-13 * (1 + std::abs(expected))) << s;
  }
}

// F = I + g e_x e_y^T: F^T F and the rotation by atan(g / 2) are known.
TYPED_TEST(MaterialTest, SimpleShearHasTheAnalyticStress) {
  for (const double g : {-0.5, 0.1, 0.8, 2.0}) {
    Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
    H(0, 1) = g;
    const double stress = TypeParam::first_piola_kirchhoff(H, kLame)(0, 1);
    double expected = 0;
    if constexpr (std::is_same_v<TypeParam, StVenantKirchhoff>)
      expected = kLame.mu * g + (0.5 * kLame.lambda + kLame.mu) * g * g * g;
    if constexpr (std::is_same_v<TypeParam, Corotational>) {
      const double length = std::sqrt(4 + g * g), sine = g / length;
      expected = 2 * kLame.mu * (g - sine) + kLame.lambda * (length - 2) * sine;
    }
    if constexpr (std::is_same_v<TypeParam, StableNeoHookean>) expected = 4 * kLame.mu / 3 * g * (1 - 1 / (4 + g * g));
    EXPECT_NEAR(stress, expected, 1e-12 * (1 + std::abs(expected))) << g;
  }
}

TEST(Polar, TheRotationIsThatOfTheSingularVectorsAlsoWhereFIsInverted) {
  for (const double last : {1.0, 0.3, -0.3, -0.49})
    for (std::uint32_t seed = 0; seed < 20; ++seed) {
      const Eigen::Matrix3d U = random_rotation(seed), V = random_rotation(seed + 50);
      const Eigen::Matrix3d F = U * Eigen::Vector3d(1.4, 0.5, last).asDiagonal() * V.transpose();
      const Eigen::Matrix3d R = kIdentity + polar_rotation_less_identity(F - kIdentity);
      EXPECT_LE((R - U * V.transpose()).norm(), 1e-15 * 10 / std::min(1.0, 0.5 + last));
    }
}

TEST(StableNeoHookean, IsFiniteAndPushesAnInvertedElementUpright) {
  for (const double stretch : {0.0, -0.2, -1.0, -3.0}) {
    Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
    H(2, 2) = stretch - 1;
    EXPECT_TRUE(std::isfinite(StableNeoHookean::energy(H, kLame)));
    EXPECT_LT(StableNeoHookean::first_piola_kirchhoff(H, kLame)(2, 2), 0) << "energy falls towards F = I";
    EXPECT_LT(Corotational::first_piola_kirchhoff(H, kLame)(2, 2), 0);
  }
  const Eigen::Matrix3d nothing = -kIdentity;  // F = 0
  EXPECT_TRUE(std::isfinite(StableNeoHookean::energy(nothing, kLame)));
  EXPECT_TRUE(Corotational::tangent(nothing, kLame).allFinite());
  EXPECT_TRUE(Corotational::first_piola_kirchhoff(nothing, kLame).allFinite());
}

// Psi on a grid of principal stretches: nothing is below rest down to the limit, something is not far beyond.
TEST(StableNeoHookean, RestIsTheLowestStateDownToTheLeastPoissonRatio) {
  const auto lowest = [](double poisson_ratio) {
    const LameParameters lame = lame_parameters(1, poisson_ratio);
    double energy = 0;
    for (double a = 0; a < 2; a += 0.05)
      for (double b = 0; b < 2; b += 0.05)
        for (double c = 0; c < 2; c += 0.05)
          energy = std::min(energy, StableNeoHookean::energy(Eigen::Vector3d(a - 1, b - 1, c - 1).asDiagonal(), lame));
    return energy;
  };
  const double least = least_poisson_ratio(MaterialModel::kStableNeoHookean);
  EXPECT_GE(lowest(least), -1e-15);
  EXPECT_LT(lowest(least - 0.1), -1e-4);
}

}  // namespace
}  // namespace exmat
