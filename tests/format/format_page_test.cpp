#include <cstdlib>
#include <gtest/gtest.h>
#include <regex>
#include <string>

#include "common/bundle/format_doc.h"
#include "common/hdf5/hdf5_file.h"
#include "tests/common/bundle/small_model.h"

namespace exmat {
namespace {

const std::string kSourceFolder = EXMAT_SOURCE_DIR;

TEST(FormatPage, IsTheGeneratedOne) {
  const std::string page = kSourceFolder + "/docs/bundle_format.md";
  if (std::getenv("EXMAT_UPDATE_DOCS") != nullptr) test::write_file(page, format_page());
  EXPECT_EQ(test::read_file(page), format_page()) << "run this test with EXMAT_UPDATE_DOCS=1";
}

TEST(GeneratorName, HasTheProjectsVersion) {
  const std::string project = test::read_file(kSourceFolder + "/CMakeLists.txt");
  std::smatch match;
  ASSERT_TRUE(std::regex_search(project, match, std::regex("project\\(exmat VERSION ([0-9.]+)")));
  EXPECT_EQ(generator_name(), "exmat " + match[1].str());
}

}  // namespace
}  // namespace exmat
