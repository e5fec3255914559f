#include "precompute/modes/basis.h"

#include <array>
#include <gtest/gtest.h>
#include <optional>
#include <random>

#include "common/core/decompositions.h"
#include "common/core/error.h"
#include "common/elastic/materials.h"
#include "common/mesh/geometry.h"
#include "precompute/modes/field_clamp.h"
#include "tests/support/box_mesh.h"

namespace exmat::precompute {
namespace {

// 3n internal force at a displacement, element by element.
Eigen::VectorXd internal_force(const TetMesh& mesh, const TetMaterials& materials, const Eigen::VectorXd& u) {
  Eigen::VectorXd force = Eigen::VectorXd::Zero(u.size());
  const Eigen::VectorXd volumes = tet_volumes(mesh);
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t) {
    const auto gradients = shape_gradients(tet_positions(mesh, t));
    Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
    for (int c = 0; c < 4; ++c) H += u.segment<3>(3 * mesh.tets(t, c)) * gradients.row(c);
    const Eigen::Matrix3d P = with_material(materials.model, [&](auto material) {
      return material.first_piola_kirchhoff(H,
                                            lame_parameters(materials.youngs_modulus[t], materials.poisson_ratio[t]));
    });
    for (int c = 0; c < 4; ++c) force.segment<3>(3 * mesh.tets(t, c)) += volumes[t] * P * gradients.row(c).transpose();
  }
  return force;
}

class Basis : public testing::TestWithParam<bool> {
 protected:
  Basis() { make({6, 2, 2}, 6); }
  void make(const std::array<int, 3>& cells, int modes) {
    mesh_ = test::box_mesh(cells, {1.0, 0.3, 0.25});
    materials_ = {Eigen::VectorXd::LinSpaced(mesh_.tet_count(), 800, 1200),
                  Eigen::VectorXd::Constant(mesh_.tet_count(), 1e5),
                  Eigen::VectorXd::Constant(mesh_.tet_count(), 0.35)};
    FlagVector fixed = FlagVector::Zero(mesh_.vertex_count());
    for (Eigen::Index v = 0; clamped() && v < fixed.size(); ++v) fixed[v] = mesh_.vertices(v, 0) < 1e-9 ? 1 : 0;
    system_ = build_elastic_system(mesh_, materials_, fixed);
    solver_.emplace(system_.stiffness, system_.mass * system_.null_space, "test");
    modes_ = linear_modes(system_, *solver_, modes);
    derivatives_ = modal_derivatives(mesh_, materials_, system_, *solver_, modes_.modes);
  }
  static bool clamped() { return GetParam(); }
  Eigen::MatrixXd basis(int size, const Eigen::MatrixXd& fields = {}) const {
    return modal_basis({system_, modes_, derivatives_, bounding_box_diagonal(mesh_.vertices), fields}, size);
  }

  TetMesh mesh_;
  TetMaterials materials_;
  ElasticSystem system_;
  std::optional<SemidefiniteSolver> solver_;
  LinearModes modes_;
  Eigen::MatrixXd derivatives_;
};

INSTANTIATE_TEST_SUITE_P(Bodies, Basis, testing::Bool(),
                         [](const auto& body) { return body.param ? "clamped" : "free"; });

// The force is a cubic polynomial: the mixed central difference is its second derivative but for rounding.
TEST_P(Basis, ModalDerivativesSolveTheDifferentiatedEquilibrium) {
  const double amplitude = 0.1 * bounding_box_diagonal(mesh_.vertices);
  const Eigen::MatrixXd fields = system_.extend(modes_.modes);
  const auto f = [this](const Eigen::VectorXd& u) { return internal_force(mesh_, materials_, u); };
  for (Eigen::Index j = 0; j < 6; ++j)
    for (Eigen::Index i = 0; i <= j; ++i) {
      const double si = amplitude / fields.col(i).cwiseAbs().maxCoeff(),
                   sj = amplitude / fields.col(j).cwiseAbs().maxCoeff();
      const Eigen::VectorXd a = si * fields.col(i), b = sj * fields.col(j);
      const Eigen::VectorXd second = (f(a + b) - f(a - b) - f(b - a) + f(-a - b)) / (4 * si * sj);
      Eigen::VectorXd load = -system_.restrict(second);
      if (system_.null_space.cols() > 0)
        load -= system_.mass * (system_.null_space * (system_.null_space.transpose() * load));
      const Eigen::VectorXd residual = system_.stiffness * derivatives_.col(pair_index(i, j)) - load;
      EXPECT_LE(residual.norm(), 1e-9 * load.norm()) << i << " " << j;
    }
}

// Mixed differences of other materials err by h^2; two of them, extrapolated, by h^4.
TEST_P(Basis, ModalDerivativesAreThoseOfTheMaterial) {
  const double size = bounding_box_diagonal(mesh_.vertices);
  const Eigen::MatrixXd fields = system_.extend(modes_.modes);
  for (const auto model : {MaterialModel::kStableNeoHookean, MaterialModel::kCorotational}) {
    materials_.model = model;
    const auto derivatives = modal_derivatives(mesh_, materials_, system_, *solver_, modes_.modes);
    EXPECT_GT((derivatives - derivatives_).norm(), 1e-3 * derivatives_.norm());
    const auto f = [this](const Eigen::VectorXd& u) { return internal_force(mesh_, materials_, u); };
    for (Eigen::Index j = 0; j < 6; ++j)
      for (Eigen::Index i = 0; i <= j; ++i) {
        const auto second = [&](double amplitude) -> Eigen::VectorXd {
          const double si = amplitude / fields.col(i).cwiseAbs().maxCoeff(),
                       sj = amplitude / fields.col(j).cwiseAbs().maxCoeff();
          const Eigen::VectorXd a = si * fields.col(i), b = sj * fields.col(j);
          return (f(a + b) - f(a - b) - f(b - a) + f(-a - b)) / (4 * si * sj);
        };
        const double h = 2e-3 * size;
        Eigen::VectorXd load = system_.restrict((second(h) - 4 * second(h / 2)) / 3);
        if (system_.null_space.cols() > 0)
          load -= system_.mass * (system_.null_space * (system_.null_space.transpose() * load));
        const Eigen::VectorXd residual = system_.stiffness * derivatives.col(pair_index(i, j)) - load;
        EXPECT_LE(residual.norm(), 1e-6 * load.norm()) << name_of(model) << " " << i << " " << j;
      }
  }
}

TEST_P(Basis, IsMassOrthonormalAndFreeOfRigidMotion) {
  const auto U = basis(20);
  EXPECT_LE((U.transpose() * (system_.mass * U) - Eigen::MatrixXd::Identity(20, 20)).cwiseAbs().maxCoeff(), 1e-12);
  if (!clamped()) {
    EXPECT_LE((system_.null_space.transpose() * (system_.mass * U)).cwiseAbs().maxCoeff(), 1e-12);
  }
}

// Derivatives of modes hold rigid motions, too, which are no deformations.
TEST_P(Basis, HasAtMostAsManyColumnsAsThereAreDeformations) {
  make({1, 1, 1}, 9);
  const int most = clamped() ? 12 : 18;
  EXPECT_EQ(basis(most).cols(), most);
  EXPECT_THROW(basis(most + 1), InputError);
}

TEST_P(Basis, DoesNotDependOnUnits) {
  const auto U = basis(15);
  mesh_.vertices *= 1000;  // millimetres
  materials_.density *= 1e-9;
  materials_.youngs_modulus *= 1e-3;
  FlagVector fixed = FlagVector::Zero(mesh_.vertex_count());
  for (Eigen::Index v = 0; clamped() && v < fixed.size(); ++v) fixed[v] = mesh_.vertices(v, 0) < 1e-9 ? 1 : 0;
  const auto other = build_elastic_system(mesh_, materials_, fixed);
  const SemidefiniteSolver solver(other.stiffness, other.mass * other.null_space, "test");
  const auto modes = linear_modes(other, solver, 6);
  const auto derivatives = modal_derivatives(mesh_, materials_, other, solver, modes.modes);
  const Eigen::MatrixXd V = modal_basis({other, modes, derivatives, bounding_box_diagonal(mesh_.vertices), {}}, 15);
  // The spans agree: the projection of one basis onto the other has singular values of one.
  const Eigen::MatrixXd overlap = U.transpose() * (system_.mass * V);
  const Eigen::VectorXd scaled =
      overlap.colwise().norm() / V.colwise().norm().maxCoeff() * U.colwise().norm().maxCoeff();
  const Eigen::MatrixXd unit = V * std::sqrt(1 / (V.col(0).dot(system_.mass * V.col(0))));
  EXPECT_LE((unit - U * (U.transpose() * (system_.mass * unit))).norm(), 1e-6 * unit.norm());
}

TEST_P(Basis, HoldsTheExampleFields) {
  std::mt19937 generator(7);
  std::normal_distribution<double> normal;
  Eigen::MatrixXd fields = Eigen::MatrixXd::NullaryExpr(system_.full_mass.rows(), 2, [&] { return normal(generator); });
  const Eigen::MatrixXd clamped_fields = FieldClamp(system_, 0, "test").apply(fields);
  const auto U = basis(20, clamped_fields);
  Eigen::MatrixXd deforming = clamped_fields;
  if (system_.null_space.cols() > 0)
    deforming -= system_.null_space * (system_.null_space.transpose() * (system_.mass * deforming));
  EXPECT_LE((deforming - U * (U.transpose() * (system_.mass * deforming))).norm(), 1e-10 * deforming.norm());
  EXPECT_LE((U.transpose() * (system_.mass * U) - Eigen::MatrixXd::Identity(20, 20)).cwiseAbs().maxCoeff(), 1e-12);
}

// As many components as a plain SVD of the factored unit fields says, and half of 30 beside them; both bases hold each
// field to 2 % then.
TEST_P(Basis, GrowsWithWhatManyExamplesNeed) {
  std::mt19937 generator(7);
  std::normal_distribution<double> normal;
  const auto random = [&](Eigen::Index rows, Eigen::Index columns) {
    return Eigen::MatrixXd::NullaryExpr(rows, columns, [&] { return normal(generator); }).eval();
  };
  Eigen::MatrixXd fields = random(system_.mass.rows(), 19) * random(19, 24) + 0.02 * random(system_.mass.rows(), 24);
  EXPECT_EQ(basis_size_for(system_, fields.leftCols(15)), 30);
  if (system_.null_space.cols() > 0)
    fields -= system_.null_space * (system_.null_space.transpose() * (system_.mass * fields));
  for (auto field : fields.colwise()) field /= std::sqrt(field.dot(system_.mass * field));
  const Eigen::MatrixXd factored = Eigen::MatrixXd(system_.mass).llt().matrixU() * fields;
  const auto svd = factored.bdcSvd(Eigen::ComputeThinU);
  const auto lost_by = [&](Eigen::Index count) {
    const Eigen::MatrixXd U = svd.matrixU().leftCols(count);
    return (factored - U * (U.transpose() * factored)).colwise().norm().maxCoeff();
  };
  const int size = basis_size_for(system_, fields);
  EXPECT_GT(size, 30);
  EXPECT_LE(lost_by(size - 15), 0.02);
  EXPECT_GT(lost_by(size - 16), 0.02);
  const BasisInput input{system_, modes_, derivatives_, bounding_box_diagonal(mesh_.vertices), fields};
  const Eigen::MatrixXd motions = modes_.modes.leftCols(2);
  for (const Eigen::MatrixXd& U : {modal_basis(input, size), trained_basis(input, motions, false, size),
                                   trained_basis(input, motions, true, size)}) {
    ASSERT_EQ(U.cols(), size);
    EXPECT_LE((U.transpose() * (system_.mass * U) - Eigen::MatrixXd::Identity(size, size)).cwiseAbs().maxCoeff(),
              1e-12);
    for (const Eigen::VectorXd field : fields.colwise()) {
      const Eigen::VectorXd rest = field - U * (U.transpose() * (system_.mass * field));
      EXPECT_LE(std::sqrt(rest.dot(system_.mass * rest)), 0.02);
    }
  }
}

TEST_P(Basis, ClampedFieldsAreInEquilibriumWithTheirClamp) {
  if (!clamped()) GTEST_SKIP();
  const Eigen::MatrixXd fields = Eigen::MatrixXd::Random(system_.full_mass.rows(), 1);
  for (const double decay : {0.0, 1e4}) {
    const SparseMatrix full = system_.full_stiffness + decay * system_.full_mass;
    const Eigen::MatrixXd correction = system_.extend(FieldClamp(system_, decay, "test").apply(fields)) - fields;
    // The correction cancels the field on the clamp and loads no free vertex.
    EXPECT_LE(system_.restrict(full * correction).norm(), 1e-10 * (full * fields).norm());
  }
}

// Principal components are the best there are. What they lose of the snapshots, in the norm that they are taken in, is
// at least the tail of the singular values, which a plain SVD of the factored columns gives, and at most that and all
// that is mixed in: 3 % of the norm.
TEST_P(Basis, OfMotionsLosesNoMoreThanTheSingularValuesSay) {
  const Eigen::Index count = 12, size = 5;
  Eigen::MatrixXd motions = modes_.modes * Eigen::MatrixXd::Random(6, count);
  motions += 1e-2 * Eigen::MatrixXd::Random(motions.rows(), count);
  if (system_.null_space.cols() > 0)
    motions -= system_.null_space * (system_.null_space.transpose() * (system_.mass * motions));
  const BasisInput input{system_, modes_, derivatives_, bounding_box_diagonal(mesh_.vertices), {}};
  const Eigen::MatrixXd U = trained_basis(input, motions, false, size);
  EXPECT_LE((U.transpose() * (system_.mass * U) - Eigen::MatrixXd::Identity(size, size)).cwiseAbs().maxCoeff(), 1e-12);
  const Eigen::MatrixXd norm =
      Eigen::MatrixXd(system_.mass) + Eigen::MatrixXd(system_.stiffness) / modes_.eigenvalues[4];
  const Eigen::MatrixXd factor = norm.llt().matrixU();
  const Eigen::VectorXd sigma = Eigen::MatrixXd(factor * motions).bdcSvd().singularValues();
  const Eigen::MatrixXd inside = factor * U;
  const Eigen::MatrixXd projected = inside * inside.householderQr().solve(factor * motions);
  const double lost = (factor * motions - projected).squaredNorm(), least = sigma.tail(count - size).squaredNorm();
  EXPECT_GE(lost, least - 1e-9 * sigma.squaredNorm());
  EXPECT_LE(lost, least + 0.03 * 0.03 * sigma.squaredNorm());
}

TEST_P(Basis, OfFewMotionsHoldsModesToo) {
  Eigen::MatrixXd motions = modes_.modes.leftCols(2);
  const BasisInput input{system_, modes_, derivatives_, bounding_box_diagonal(mesh_.vertices), {}};
  const Eigen::MatrixXd U = trained_basis(input, motions, false, 10);
  ASSERT_EQ(U.cols(), 10);
  EXPECT_LE((U.transpose() * (system_.mass * U) - Eigen::MatrixXd::Identity(10, 10)).cwiseAbs().maxCoeff(), 1e-12);
  const auto lost = [&](const Eigen::MatrixXd& u) {
    const Eigen::MatrixXd rest = u - U * (U.transpose() * (system_.mass * u));
    return std::sqrt(rest.cwiseProduct(system_.mass * rest).sum() / u.cwiseProduct(system_.mass * u).sum());
  };
  EXPECT_LE(lost(motions), 0.001);
  EXPECT_LE(lost(modes_.modes.col(2)), 0.05);  // no motion has shown it
}

// Poses are there for whoever asks for them. Forty motions that never come near two of them fill a basis of ten; the
// two are put first then, and held to rounding.
TEST_P(Basis, OfMotionsHoldsExamplesThatNoMotionShows) {
  const auto deforming = [&](Eigen::MatrixXd fields) {
    if (system_.null_space.cols() > 0)
      fields -= system_.null_space * (system_.null_space.transpose() * (system_.mass * fields));
    return fields;
  };
  const Eigen::MatrixXd fields = deforming(Eigen::MatrixXd::Random(system_.mass.rows(), 2));
  const Eigen::MatrixXd motions = deforming(Eigen::MatrixXd::Random(system_.mass.rows(), 40));
  const double size = bounding_box_diagonal(mesh_.vertices);
  const auto lost = [&](const Eigen::MatrixXd& U, const Eigen::VectorXd& field) {
    const Eigen::VectorXd rest = field - U * (U.transpose() * (system_.mass * field));
    return std::sqrt(rest.dot(system_.mass * rest) / field.dot(system_.mass * field));
  };
  const Eigen::MatrixXd without = trained_basis({system_, modes_, derivatives_, size, {}}, motions, false, 10);
  const Eigen::MatrixXd with = trained_basis({system_, modes_, derivatives_, size, fields}, motions, false, 10);
  for (const Eigen::VectorXd field : fields.colwise()) {
    EXPECT_GT(lost(without, field), 0.5);
    EXPECT_LE(lost(with, field), 1e-9);
  }
  // A basis that may grow has a mode more for each of them.
  const Eigen::MatrixXd grown = trained_basis({system_, modes_, derivatives_, size, fields}, motions, false, 10, true);
  ASSERT_EQ(grown.cols(), 12);
  EXPECT_LE((grown.transpose() * (system_.mass * grown) - Eigen::MatrixXd::Identity(12, 12)).cwiseAbs().maxCoeff(),
            1e-12);
  for (const Eigen::VectorXd field : fields.colwise()) EXPECT_LE(lost(grown, field), 0.005);
}

// The mix holds a motion that modes do not, and modes that no motion has shown.
TEST_P(Basis, OfTheMixHoldsMotionsAndModes) {
  Eigen::MatrixXd motion = Eigen::MatrixXd::Random(system_.mass.rows(), 1);
  if (system_.null_space.cols() > 0)
    motion -= system_.null_space * (system_.null_space.transpose() * (system_.mass * motion));
  const BasisInput input{system_, modes_, derivatives_, bounding_box_diagonal(mesh_.vertices), {}};
  const Eigen::MatrixXd U = trained_basis(input, motion, true, 12);
  const auto lost = [&](const Eigen::MatrixXd& u) {
    const Eigen::MatrixXd rest = u - U * (U.transpose() * (system_.mass * u));
    return std::sqrt(rest.cwiseProduct(system_.mass * rest).sum() / u.cwiseProduct(system_.mass * u).sum());
  };
  EXPECT_LE(lost(motion), 0.05);
  EXPECT_LE(lost(modes_.modes.leftCols(1)), 0.05);
}

TEST_P(Basis, MoreModesThanSnapshotsAreRefused) {
  try {
    basis(28);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("expected at most 27"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace exmat::precompute
