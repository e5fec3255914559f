#include "precompute/polynomial/internal_force.h"

#include <gtest/gtest.h>

#include "common/core/error.h"
#include "precompute/cubature/element_samples.h"
#include "precompute/polynomial/reduced_polynomial.h"
#include "tests/support/box_mesh.h"
#include "tests/support/random.h"

namespace exmat::precompute {
namespace {

// A body of random modes with its polynomial, and the first tets of the mesh as cubature elements.
ReducedModel model_of(Eigen::Index modes, Eigen::Index elements) {
  ReducedModel model;
  ObjectData& object = model.object.emplace();
  object.mesh = test::box_mesh({6, 4, 2}, {1.0, 0.7, 0.3});
  const Eigen::Index tets = object.mesh.tet_count();
  object.materials = {Eigen::VectorXd::Constant(tets, 1000), Eigen::VectorXd::Constant(tets, 1e6),
                      Eigen::VectorXd::Constant(tets, 0.3)};
  model.modal.emplace().basis = test::random_matrix(3 * object.mesh.vertex_count(), modes, 3);
  const ElementSamples samples(object.mesh, object.materials, model.modal->basis);
  CubatureData& cubature = model.cubature.emplace();
  cubature.elements = IndexVector::LinSpaced(elements, 0, static_cast<std::int32_t>(elements - 1));
  cubature.weights.setOnes(elements);
  cubature.volumes.setOnes(elements);
  cubature.gradient.resize(9 * elements, modes);
  for (Eigen::Index t = 0; t < elements; ++t) cubature.gradient.middleRows(9 * t, 9) = samples.gradient(t);
  cubature.youngs_modulus = object.materials.youngs_modulus.head(elements);
  cubature.poisson_ratio = object.materials.poisson_ratio.head(elements);
  cubature.heldout_error = 0.02;
  model.polynomial = reduced_polynomial(object.mesh, object.materials, model.modal->basis);
  return model;
}

TEST(TakesPolynomial, AsMeasuredWhereThatIsClearElseAsModelled) {
  for (const double modelled : {0.1, 0.99, 1.01, 10.0}) {
    EXPECT_TRUE(takes_polynomial(0.1, modelled));
    EXPECT_TRUE(takes_polynomial(0.8, modelled));
    EXPECT_FALSE(takes_polynomial(1.25, modelled));
    EXPECT_FALSE(takes_polynomial(10, modelled));
    for (const double measured : {0.81, 1.0, 1.24}) EXPECT_EQ(takes_polynomial(measured, modelled), modelled < 1);
  }
}

// A hundredth of the arithmetic.
TEST(ChooseInternalForce, TakesASmallPolynomialForMuchCubature) {
  ReducedModel model = model_of(6, 250);
  choose_internal_force(ForceMethod::kAuto, std::nullopt, model);
  EXPECT_TRUE(model.polynomial);
  EXPECT_EQ(model.cubature->internal_force, ForceMethod::kPolynomial);
  EXPECT_EQ(model.cubature->internal_force_reason, "exact, and as fast as 250 cubature elements or faster at r = 6");
}

// A hundred times the arithmetic.
TEST(ChooseInternalForce, TakesLittleCubatureForALargePolynomial) {
  ReducedModel model = model_of(40, 2);
  choose_internal_force(ForceMethod::kAuto, 0.05, model);
  EXPECT_FALSE(model.polynomial);
  EXPECT_EQ(model.cubature->internal_force, ForceMethod::kCubature);
  EXPECT_EQ(model.cubature->internal_force_reason,
            "2 cubature elements are as fast as the polynomial or faster at r = 40");
}

TEST(ChooseInternalForce, TakesThePolynomialWhereCubatureMissesItsTolerance) {
  ReducedModel model = model_of(40, 2);
  choose_internal_force(ForceMethod::kAuto, 0.01, model);
  EXPECT_TRUE(model.polynomial);
  EXPECT_EQ(model.cubature->internal_force, ForceMethod::kPolynomial);
  EXPECT_EQ(model.cubature->internal_force_reason, "exact, where 2 cubature elements miss the tolerance");
}

TEST(ChooseInternalForce, TakesWhatIsAskedFor) {
  ReducedModel model = model_of(12, 2);
  choose_internal_force(ForceMethod::kPolynomial, std::nullopt, model);
  EXPECT_TRUE(model.polynomial);
  EXPECT_EQ(model.cubature->internal_force, ForceMethod::kPolynomial);
  choose_internal_force(ForceMethod::kCubature, 0.01, model);
  EXPECT_FALSE(model.polynomial);
  EXPECT_EQ(model.cubature->internal_force, ForceMethod::kCubature);
  EXPECT_EQ(model.cubature->internal_force_reason, "it is asked for");
}

// Sizes alone, no numbers.
ReducedModel sizes_of(Eigen::Index modes, Eigen::Index elements, Eigen::Index tets) {
  ReducedModel model;
  model.object.emplace().mesh.tets.resize(tets, 4);
  CubatureData& cubature = model.cubature.emplace();
  cubature.elements.resize(elements);
  cubature.weights.setOnes(elements);
  cubature.volumes.setOnes(elements);
  cubature.gradient.setZero(9 * elements, modes);
  cubature.youngs_modulus.setOnes(elements);
  cubature.poisson_ratio.setZero(elements);
  cubature.heldout_error = 0.02;
  return model;
}

TEST(ReasonAgainstThePolynomial, IsItsSizeOrTheMaterial) {
  EXPECT_EQ(reason_against_polynomial(sizes_of(64, 2000, 1000), std::nullopt), "");
  EXPECT_EQ(reason_against_polynomial(sizes_of(65, 2000, 10), std::nullopt),
            "a polynomial of more than 64 modes is slow");
  EXPECT_EQ(reason_against_polynomial(sizes_of(64, 2000, 10000), std::nullopt),
            "the polynomial takes too long to precompute");
  ReducedModel rubber = sizes_of(5, 10, 10);
  rubber.object->materials.model = MaterialModel::kCorotational;
  EXPECT_EQ(reason_against_polynomial(rubber, std::nullopt), "the material has no polynomial");
}

TEST(ReasonAgainstThePolynomial, IsCubatureThatIsFarFasterAndGoodEnough) {
  const ReducedModel model = sizes_of(42, 21, 1000);
  const std::string slower = "21 cubature elements are as fast as the polynomial or faster at r = 42";
  EXPECT_EQ(reason_against_polynomial(model, std::nullopt), slower);
  EXPECT_EQ(reason_against_polynomial(model, 0.03), slower);
  EXPECT_EQ(reason_against_polynomial(model, 0.01), "");
  EXPECT_EQ(reason_against_polynomial(sizes_of(20, 40, 1000), std::nullopt), "");
}

TEST(RequirePolynomial, RefusesOtherMaterialsAndManyModes) {
  EXPECT_NO_THROW(require_polynomial(MaterialModel::kStVenantKirchhoff, 160));
  EXPECT_THROW(require_polynomial(MaterialModel::kStVenantKirchhoff, 161), InputError);
  EXPECT_THROW(require_polynomial(MaterialModel::kStableNeoHookean, 5), InputError);
}

}  // namespace
}  // namespace exmat::precompute
