#include "precompute/inputs/object_size.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/box_mesh.h"

namespace exmat::precompute {
namespace {

using testing::AllOf;
using testing::HasSubstr;

std::string remark(double length, double modulus, double density = 1000) {
  const TetMesh mesh = test::box_mesh({4, 1, 1}, {length, length / 4, length / 4});
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
    EXPECT_THAT(remark(1000 * length, modulus, density), HasSubstr("are its numbers millimetres?")) << length;
  }
}

// 1000 x 9.81 x 40 / 1e5 = 3.924.
TEST(ObjectSize, TheReasonIsNamed) {
  EXPECT_THAT(remark(40, 1e5),
              AllOf(HasSubstr("40 m long"), HasSubstr("is 3.92 times its Young's modulus of 1e+05 Pa")));
  EXPECT_THAT(remark(60, 1e9), HasSubstr("the object is 60 m long; "));
}

}  // namespace
}  // namespace exmat::precompute
