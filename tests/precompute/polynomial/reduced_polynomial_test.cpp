#include "precompute/polynomial/reduced_polynomial.h"

#include <cmath>
#include <gtest/gtest.h>
#include <omp.h>
#include <string>

#include "common/core/error.h"
#include "common/elastic/st_venant_kirchhoff.h"
#include "common/mesh/geometry.h"
#include "tests/support/box_mesh.h"
#include "tests/support/random.h"

namespace exmat::precompute {
namespace {

struct Case {
  const char* name;
  Eigen::Index modes;
  bool clamped;
};
void PrintTo(const Case& which, std::ostream* stream) { *stream << which.name; }

struct Response {
  double energy = 0;
  Eigen::VectorXd force;
  Eigen::MatrixXd stiffness;
};

// The tensors, entry by entry.
class Tensors {
 public:
  explicit Tensors(const PolynomialData& data) : data_(data) {}

  double cubic(Eigen::Index i, Eigen::Index j, Eigen::Index k) const { return data_.cubic(pair(i, j), k); }
  double quartic(Eigen::Index i, Eigen::Index j, Eigen::Index k, Eigen::Index l) const {
    return data_.quartic[pair(pair(i, j), pair(k, l))];
  }

  Response at(const Eigen::VectorXd& q) const {
    const Eigen::Index r = q.size();
    Eigen::MatrixXd linear = Eigen::MatrixXd::Zero(r, r), quadratic = linear;  // C_ijk q_k, D_ijkl q_k q_l
    for (Eigen::Index i = 0; i < r; ++i)
      for (Eigen::Index j = 0; j < r; ++j)
        for (Eigen::Index k = 0; k < r; ++k) {
          linear(i, j) += cubic(i, j, k) * q[k];
          for (Eigen::Index l = 0; l < r; ++l) quadratic(i, j) += quartic(i, j, k, l) * q[k] * q[l];
        }
    return {q.dot((data_.stiffness / 2 + linear / 6 + quadratic / 24) * q),
            (data_.stiffness + linear / 2 + quadratic / 6) * q, data_.stiffness + linear + quadratic / 2};
  }

 private:
  static Eigen::Index pair(Eigen::Index i, Eigen::Index j) {
    return std::max(i, j) * (std::max(i, j) + 1) / 2 + std::min(i, j);
  }

  const PolynomialData& data_;
};

class ReducedPolynomial : public testing::TestWithParam<Case> {
 protected:
  ReducedPolynomial() {
    const Eigen::Index count = mesh_.tet_count();
    materials_ = {Eigen::VectorXd::Constant(count, 1000), Eigen::VectorXd::LinSpaced(count, 1e5, 3e6),
                  Eigen::VectorXd::LinSpaced(count, -0.8, 0.49)};
    basis_ = 0.1 * test::random_matrix(3 * mesh_.vertex_count(), GetParam().modes, 5);
    for (Eigen::Index v = 0; v < mesh_.vertex_count(); ++v)
      if (GetParam().clamped && mesh_.vertices(v, 0) < 1e-9) basis_.middleRows(3 * v, 3).setZero();
    data_ = reduced_polynomial(mesh_, materials_, basis_);
  }

  // The sum over all tets, from the nodes.
  Response summed(const Eigen::VectorXd& q) const {
    const Eigen::VectorXd u = basis_ * q, volumes = tet_volumes(mesh_);
    Response sum{0, Eigen::VectorXd::Zero(q.size()), Eigen::MatrixXd::Zero(q.size(), q.size())};
    for (Eigen::Index t = 0; t < mesh_.tet_count(); ++t) {
      const auto gradients = shape_gradients(tet_positions(mesh_, t));
      const auto lame = lame_parameters(materials_.youngs_modulus[t], materials_.poisson_ratio[t]);
      Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
      RowMatrix B = RowMatrix::Zero(9, q.size());
      for (int c = 0; c < 4; ++c) {
        const Eigen::Index vertex = mesh_.tets(t, c);
        H += u.segment<3>(3 * vertex) * gradients.row(c);
        for (int a = 0; a < 3; ++a) B.middleRows<3>(3 * a) += gradients.row(c).transpose() * basis_.row(3 * vertex + a);
      }
      const RowMatrix3 P = StVenantKirchhoff::first_piola_kirchhoff(H, lame);
      sum.energy += volumes[t] * StVenantKirchhoff::energy(H, lame);
      sum.force += volumes[t] * B.transpose() * P.reshaped<Eigen::RowMajor>();
      sum.stiffness += volumes[t] * B.transpose() * StVenantKirchhoff::tangent(H, lame) * B;
    }
    return sum;
  }

  TetMesh mesh_ = test::box_mesh({4, 3, 2}, {1.0, 0.7, 0.5});
  TetMaterials materials_;
  RowMatrix basis_;
  PolynomialData data_;
};

INSTANTIATE_TEST_SUITE_P(Each, ReducedPolynomial,
                         testing::Values(Case{"FiveFree", 5, false}, Case{"TwelveClamped", 12, true},
                                         Case{"ThirtyFree", 30, false}, Case{"ThirtyClamped", 30, true}),
                         [](const auto& test) { return std::string(test.param.name); });

// Rounding of sums in another order, which is about 1e-15; strains from 1e-3 to 100.
TEST_P(ReducedPolynomial, IsTheSumOverAllTets) {
  constexpr double kTolerance = 1e-13;
  const Tensors tensors(data_);
  for (const double size : {1e-3, 1.0, 20.0}) {
    const Eigen::VectorXd q = size / std::sqrt(static_cast<double>(GetParam().modes)) *
                              test::random_vector(GetParam().modes, static_cast<std::uint32_t>(size * 1000));
    const Response exact = summed(q), found = tensors.at(q);
    EXPECT_NEAR(found.energy, exact.energy, kTolerance * exact.energy) << size;
    EXPECT_LE((found.force - exact.force).norm(), kTolerance * exact.force.norm()) << size;
    EXPECT_LE((found.stiffness - exact.stiffness).norm(), kTolerance * exact.stiffness.norm()) << size;
  }
}

TEST_P(ReducedPolynomial, IsFullySymmetric) {
  const Tensors tensors(data_);
  EXPECT_EQ(data_.stiffness, data_.stiffness.transpose());
  const Eigen::Index r = GetParam().modes;
  for (Eigen::Index i = 0; i < r; ++i)
    for (Eigen::Index j = 0; j <= i; ++j)
      for (Eigen::Index k = 0; k <= j; ++k) {
        ASSERT_EQ(tensors.cubic(i, j, k), tensors.cubic(i, k, j));
        ASSERT_EQ(tensors.cubic(i, j, k), tensors.cubic(j, k, i));
        for (Eigen::Index l = 0; l <= k; ++l) {
          ASSERT_EQ(tensors.quartic(i, j, k, l), tensors.quartic(i, k, j, l));
          ASSERT_EQ(tensors.quartic(i, j, k, l), tensors.quartic(i, l, j, k));
        }
      }
}

TEST_P(ReducedPolynomial, IsTheSameForEveryNumberOfThreads) {
  const int before = omp_get_max_threads();
  for (const int threads : {1, 3}) {
    omp_set_num_threads(threads);
    const PolynomialData other = reduced_polynomial(mesh_, materials_, basis_);
    EXPECT_EQ(other.stiffness, data_.stiffness) << threads;
    EXPECT_EQ(other.cubic, data_.cubic) << threads;
    EXPECT_EQ(other.quartic, data_.quartic) << threads;
  }
  omp_set_num_threads(before);
}

TEST_P(ReducedPolynomial, HasThePredictedBytes) {
  EXPECT_EQ(polynomial_bytes(GetParam().modes),
            8 * (data_.stiffness.size() + data_.cubic.size() + data_.quartic.size()));
}

TEST(ReducedPolynomialOfManyModes, IsRefusedWithItsMemory) {
  const TetMesh mesh = test::cube_grid(1);
  const auto one = Eigen::VectorXd::Constant(mesh.tet_count(), 0.25);
  const RowMatrix basis = RowMatrix::Ones(3 * mesh.vertex_count(), kMostPolynomialModes + 1);
  try {
    reduced_polynomial(mesh, {one, one, one}, basis);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_EQ(error.complaint().expected, "at most 160 modes with \"polynomial\"");
    EXPECT_EQ(error.complaint().found, "161, for which it takes 0.7 GB");
  }
}

}  // namespace
}  // namespace exmat::precompute
