#include "common/hdf5/xdmf.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace exmat {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

TEST(Xdmf, NamesCellsAndFramesOfTheFileBesideIt) {
  const XdmfCells cells{"Tetrahedron", "/tets", "/vertices", 4, 7, 11};
  const std::string text = xdmf_text("some/folder/a.h5", {{"body", cells}}, {0, 0.25});
  EXPECT_THAT(text, HasSubstr("<Topology TopologyType=\"Tetrahedron\" NumberOfElements=\"7\">"));
  EXPECT_THAT(text, HasSubstr("Dimensions=\"7 4\""));
  EXPECT_THAT(text, HasSubstr(">a.h5:/tets<"));
  EXPECT_THAT(text, HasSubstr("Dimensions=\"2 11 3\""));
  EXPECT_THAT(text, HasSubstr(">1 0 0 1 1 1 1 11 3<")) << "rows of the second frame";
  EXPECT_THAT(text, HasSubstr("<Time Value=\"0.25\"/>"));
  EXPECT_THAT(text, Not(HasSubstr("folder"))) << "both are moved together";
}

TEST(Xdmf, EscapesNames) {
  const std::string text = xdmf_text("a&b.h5", {{"<body>", {"Triangle", "/t", "/v", 3, 1, 3}}}, {0});
  EXPECT_THAT(text, HasSubstr("a&amp;b.h5:/t"));
  EXPECT_THAT(text, HasSubstr("Name=\"&lt;body&gt;\""));
}

}  // namespace
}  // namespace exmat
