#include "common/core/input_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/bundle/pack_store.h"
#include "common/core/error.h"
#include "tests/support/temporary_folder.h"

namespace exmat {
namespace {

using namespace std::string_literals;
using test::TemporaryFolder;
using testing::AllOf;
using testing::HasSubstr;

std::string text_of(const std::string& bytes) {
  const TemporaryFolder folder;
  return read_text_file(folder.write("a", bytes), "a text");
}

TEST(ReadTextFile, LeavesOutTheByteOrderMark) {
  EXPECT_EQ(text_of("\xef\xbb\xbfv 1\n"), "v 1\n");
  EXPECT_EQ(text_of("v \xef\xbb\xbf\n"), "v \xef\xbb\xbf\n");
}

TEST(ReadTextFile, TakesEndsOfLinesOfAllSystems) {
  EXPECT_EQ(text_of("a\rb\r"), "a\nb\n");
  EXPECT_EQ(text_of("a\r\nb\r\n"), "a\r\nb\r\n");  // readers pass over the blank before an end
  EXPECT_EQ(text_of("a\0\rb"s), "a\0\rb"s);        // binary
}

TEST(ReadTextFile, RefusesUtf16) {
  for (const auto& [bytes, encoding] : {std::pair{"\xff\xfev\0 \0"s, "UTF-16 "},
                                        {"\xfe\xff\0v\0 "s, "UTF-16 "},
                                        {"v\0 \0"s, "UTF-16LE "},
                                        {"\0v\0 "s, "UTF-16BE "}})
    try {
      text_of(bytes);
      ADD_FAILURE();
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr(std::string("save it as UTF-8, as iconv -f ") + encoding + "-t UTF-8 does"));
    }
  EXPECT_EQ(text_of("v\0w"s), "v\0w"s);
}

TEST(KindOfFile, IsToldByTheFirstBytes) {
  EXPECT_THAT(kind_of_file("a", "\x89HDF\r\n\x1a\n"), HasSubstr("HDF5"));
  EXPECT_THAT(kind_of_file("a.json", "glTF\2\0\0\0"), HasSubstr("glTF"));
  EXPECT_THAT(kind_of_file("a", "PK\3\4"), HasSubstr("ZIP"));
  EXPECT_EQ(kind_of_file("a.h5", "\x89PNG\r\n\x1a\n"), "a PNG image");
  EXPECT_EQ(kind_of_file("a.obj", "\x1f\x8b\x08"), "a file that gzip packed");
  EXPECT_EQ(kind_of_file("a.h5", std::string(kPackMagic) + "..."), "a pack of a bundle");
  EXPECT_EQ(kind_of_file("a", "solid x\nfacet"), "an STL surface");
  EXPECT_EQ(kind_of_file("a.obj", "\n {\"bundle\""), kJson);
  EXPECT_EQ(kind_of_file("a.json", "["), "");
  EXPECT_EQ(kind_of_file("a", ""), "");
}

TEST(KindOfFile, IsToldByTheExtensionWhereBytesSayNothing) {
  EXPECT_EQ(kind_of_file("A.OBJ", "# Blender\nv 0 0 0"), "an .obj surface");
  EXPECT_EQ(kind_of_file("a.veg", "# by hand\n*VERTICES"), "a .veg mesh");
  EXPECT_EQ(kind_of_file("a.node", "4 3 0 0"), "a TetGen mesh");
}

TEST(RefuseExtension, SaysTheWayToOneThatIsRead) {
  const auto refusal = [](const char* file) {
    try {
      refuse_extension(file, "a mesh");
    } catch (const InputError& error) {
      return std::string(error.what());
    }
  };
  EXPECT_THAT(refusal("a.FBX"), AllOf(HasSubstr("'.fbx'"), HasSubstr("export it as .glb")));
  EXPECT_THAT(refusal("a.step"), HasSubstr("gmsh -3"));
  EXPECT_THAT(refusal("a.npz"), HasSubstr("from Python: exmat.precompute.write_mesh or exmat.precompute.bundle"));
  EXPECT_THAT(refusal("a.obj.gz"), HasSubstr("gunzip"));
  EXPECT_THAT(refusal("a.png"), HasSubstr("an image is no mesh"));
  EXPECT_THAT(refusal("a"), HasSubstr("no extension"));
}

TEST(LowerExtension, IsOfTheLastPoint) {
  EXPECT_EQ(lower_extension("A.B.OBJ"), ".obj");
  EXPECT_EQ(lower_extension("folder.X/a"), "");
}

}  // namespace
}  // namespace exmat
