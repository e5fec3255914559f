#include "precompute/inputs/object_size.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/core/error.h"
#include "tests/support/box_mesh.h"

namespace exmat::precompute {
namespace {

using testing::AllOf;
using testing::HasSubstr;

std::string remark(double length, double modulus, double density = 1000, double place = 0) {
  TetMesh mesh = exmat::test::box_mesh({4, 1, 1}, {length, length / 4, length / 4});
  mesh.vertices.array() += place;
  TetMaterials materials;
  materials.density = Eigen::VectorXd::Constant(mesh.tet_count(), density);
  materials.youngs_modulus = Eigen::VectorXd::Constant(mesh.tet_count(), modulus);
  return remark_on_size(mesh, materials);
}

// Rubber, jelly, a toy, steel: none of them in metres, all of them in millimetres.
TEST(ObjectSize, MillimetresAreRemarkedOn) {
  for (const auto& [length, modulus, density] : {std::tuple{0.2, 1e6, 1100.0},
                                                 {0.05, 1e4, 1000.0},
                                                 {0.3, 1e5, 300.0},
                                                 {0.1, 2e11, 7800.0},
                                                 {4.0, 6e6, 1000.0}}) {
    EXPECT_EQ(remark(length, modulus, density), "") << length;
    EXPECT_THAT(remark(1000 * length, modulus, density), HasSubstr("are its numbers millimetres or centimetres?"))
        << length;
  }
}

// 1000 x 9.81 x 40 / 1e5 = 3.924.
TEST(ObjectSize, TheReasonIsNamed) {
  EXPECT_THAT(remark(40, 1e5),
              AllOf(HasSubstr("40 m long"), HasSubstr("is 3.92 times its Young's modulus of 1e+05 Pa")));
  EXPECT_THAT(remark(60, 1e9), HasSubstr("the object is 60 m long; "));
}

TEST(ObjectSize, MetresWrittenAsMillimetresAreRemarkedOn) {
  EXPECT_THAT(remark(0.00175, 1e6), AllOf(HasSubstr("0.00175 m long"), HasSubstr("object.unit")));
  EXPECT_EQ(remark(0.01, 1e6), "");
}

// 2^-52 of a thousand million metres is a quarter of a micrometre.
TEST(ObjectSize, PlacesThatLoseDigitsAreRemarkedOn) {
  EXPECT_THAT(remark(1, 1e6, 1000, 1e9), AllOf(HasSubstr("1e+09 m from the origin"), HasSubstr("are 2e-07 m apart")));
  EXPECT_EQ(remark(1, 1e6, 1000, 1e6), "");
}

// Whatever is beyond would end in a solver, without a word of the number that it came from.
TEST(RequireNumbers, NamesNumbersThatDoublePrecisionCannotHold) {
  const TetMesh mesh = exmat::test::box_mesh({4, 1, 1}, {2, 0.5, 0.5});
  const auto refusal = [&](double density, double modulus) -> std::string {
    TetMaterials materials;
    materials.density = Eigen::VectorXd::Constant(mesh.tet_count(), density);
    materials.youngs_modulus = Eigen::VectorXd::Constant(mesh.tet_count(), modulus);
    try {
      require_numbers(mesh, materials, "asset.json");
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(refusal(1000, 1e6), "");
  EXPECT_EQ(refusal(1e-20, 1e20), "");
  EXPECT_THAT(refusal(1e300, 1e6),
              HasSubstr("asset.json: /object/material/density: expected a number whose product with "));
  EXPECT_THAT(refusal(1e-300, 1e6), HasSubstr("found 1e-300 of a body 2 m long"));
  EXPECT_THAT(refusal(1000, 1e300), HasSubstr("/object/material/youngs_modulus"));
  EXPECT_THAT(refusal(1000, 1e-300), HasSubstr("/object/material/youngs_modulus"));
  EXPECT_EQ(refusal(1000, 1e-5), "");
  EXPECT_THAT(refusal(1000, 1e-14), HasSubstr("expected at least 2e-08 Pa, 1e-12 of density x 9.81 m/s^2 x length"));
}

}  // namespace
}  // namespace exmat::precompute
