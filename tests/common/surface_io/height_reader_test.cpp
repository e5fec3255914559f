#include "common/surface_io/height_reader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/core/error.h"
#include "common/surface_io/plain_surface.h"
#include "tests/support/temporary_folder.h"

namespace exmat {
namespace {

using test::TemporaryFolder;
using testing::HasSubstr;

std::string refusal(const std::filesystem::path& file) {
  try {
    read_heights(file);
  } catch (const InputError& error) {
    return error.what();
  }
  return "no InputError";
}

TEST(HeightReader, ReadsRowsOfBlanksOrCommas) {
  const TemporaryFolder folder;
  RowMatrix expected(2, 3);
  expected << 1, 2.5, -3e-2, 4, 5, 6;
  EXPECT_EQ(read_heights(folder.write("a.txt", "# hills\n1 2.5 -3e-2\n\n4  5\t6 # last\n")), expected);
  EXPECT_EQ(read_heights(folder.write("a.csv", "1,2.5,-3e-2\r\n4, 5, 6")), expected);
}

TEST(HeightReader, NamesTheLineOfAFault) {
  const TemporaryFolder folder;
  EXPECT_THAT(refusal(folder.write("a.csv", "1,2\n3,x\n")),
              HasSubstr("a.csv: line 2: expected height 2 of the row, a finite number, found 'x'"));
  EXPECT_THAT(refusal(folder.write("b.csv", "1,2\n3\n")),
              HasSubstr("b.csv: line 2: expected 2 heights, as in the first row, found 1"));
  EXPECT_THAT(refusal(folder.write("c.csv", "1\n2\n")),
              HasSubstr("c.csv: line 1: expected 2 or more heights in a row, found 1"));
  EXPECT_THAT(refusal(folder.write("d.csv", "1 2\n")), HasSubstr("expected 2 or more rows of heights"));
  EXPECT_THAT(refusal(folder.write("e.csv", "1 nan\n2 3\n")), HasSubstr("line 1: expected height 2"));
  EXPECT_THAT(
      refusal(folder.write("f.txt", "0,5 1,5\n1,0 2,0\n")),
      HasSubstr("line 1: expected numbers between commas, or between blanks, found '0,5 1,5'; write numbers with "
                "decimal points"));
  EXPECT_THAT(refusal(folder.path() / "none.csv"), HasSubstr("none.csv: expected a text file of heights"));
}

TEST(PlainSurface, ReadsByExtension) {
  const TemporaryFolder folder;
  const SurfaceFile surface = read_plain_surface(folder.write("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"));
  EXPECT_EQ(surface.mesh.triangles.rows(), 1);
  EXPECT_EQ(surface.mesh.vertices(1, 0), 1);
  EXPECT_THROW(read_plain_surface("a.glb"), InputError);
}

}  // namespace
}  // namespace exmat
