#include "precompute/meshing/mesher_module.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "precompute/meshing/cage.h"

namespace exmat::precompute {
namespace {

TEST(MesherModule, IsThereAndNamesWhatItIsMadeWith) {
  EXPECT_NE(mesher_module().make_tets, nullptr);
  EXPECT_THAT(mesher_version(), testing::StartsWith("CGAL 5."));
  EXPECT_THAT(mesher_module().searched, testing::HasSubstr("lib/exmat"));
}

}  // namespace
}  // namespace exmat::precompute
