#include "common/core/names.h"

#include <gtest/gtest.h>

#include "common/elastic/material_model.h"
#include "common/model/choices.h"

namespace exmat {
namespace {

template <typename Enum>
class NamesOf : public ::testing::Test {};
using Enumerations = ::testing::Types<MaterialModel, Integrator, ForceMethod, TargetSource, EnergyReference, Weighting,
                                      AlignmentMethod, AlignmentFrame, CubatureMethod>;
TYPED_TEST_SUITE(NamesOf, Enumerations);

TYPED_TEST(NamesOf, AreReadAsTheyAreWritten) {
  for (const std::string_view name : kNames<TypeParam>) {
    const auto value = from_name<TypeParam>(name);
    ASSERT_TRUE(value) << name;
    EXPECT_EQ(name_of(*value), name);
  }
  EXPECT_FALSE(from_name<TypeParam>("rubber"));
  EXPECT_FALSE(from_name<TypeParam>(""));
}

TEST(Names, AreThoseOfTheirValues) {
  EXPECT_EQ(name_of(MaterialModel::kCorotational), "corotational");
  EXPECT_EQ(name_of(Integrator::kNewmark), "newmark");
  EXPECT_EQ(name_of(ForceMethod::kPolynomial), "polynomial");
  EXPECT_EQ(name_of(TargetSource::kSolve), "solve");
  EXPECT_EQ(name_of(EnergyReference::kRest), "rest");
  EXPECT_EQ(name_of(Weighting::kNone), "none");
  EXPECT_EQ(name_of(AlignmentMethod::kMap), "map");
  EXPECT_EQ(name_of(AlignmentFrame::kFree), "free");
  EXPECT_EQ(name_of(CubatureMethod::kAllElements), "all_elements");
}

}  // namespace
}  // namespace exmat
