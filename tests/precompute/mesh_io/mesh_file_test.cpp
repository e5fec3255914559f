#include "precompute/mesh_io/mesh_file.h"

#include <fstream>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <random>

#include "common/mesh/checks.h"
#include "tests/precompute/mesh_io/mesh_samples.h"

namespace exmat::precompute {
namespace {

using test::complaint_of;
using test::TemporaryFolder;
using testing::HasSubstr;

Complaint complaint_of_reading(const std::filesystem::path& file) {
  return complaint_of([&] { read_mesh(file); });
}

TEST(ReadMesh, NamesTheKnownExtensions) {
  const Complaint complaint = complaint_of_reading("body.stl");
  EXPECT_EQ(complaint.file, "body.stl");
  EXPECT_THAT(complaint.expected, HasSubstr(".mesh or .vtk"));
  EXPECT_EQ(complaint.found, "'.stl'");
  EXPECT_EQ(complaint_of_reading("body").found, "no extension");
}

TEST(ReadMesh, RefusesAMissingFileAndAFolder) {
  const TemporaryFolder folder;
  EXPECT_EQ(complaint_of_reading(folder.path("none.veg")).found, "no such file");
  EXPECT_EQ(complaint_of_reading(folder.path("none.msh")).found, "no such file");
  std::filesystem::create_directory(folder.path("folder.veg"));
  EXPECT_EQ(complaint_of_reading(folder.path("folder.veg")).found, "a folder");
}

TEST(ReadMesh, RefusesAnEmptyFile) {
  const TemporaryFolder folder;
  const auto file = folder.write("empty.msh", "");
  const Complaint complaint = complaint_of_reading(file);
  EXPECT_EQ(complaint.file, file.string());
  EXPECT_EQ(complaint.found, "an empty file");
}

TEST(ReadMesh, RefusesAFileThatCannotBeOpened) {
  const TemporaryFolder folder;
  const auto file = folder.write("closed.veg", "*VERTICES\n");
  std::filesystem::permissions(file, std::filesystem::perms::none);
  if (std::ifstream(file)) GTEST_SKIP() << "this user may read any file";
  EXPECT_THAT(complaint_of_reading(file).found, HasSubstr("cannot be opened"));
}

class EachFlavour : public testing::TestWithParam<test::Flavour> {
 protected:
  std::filesystem::path write(std::string_view bytes) const {
    return folder_.write("mesh" + GetParam().extension, bytes);
  }

  TemporaryFolder folder_;
};

TEST_P(EachFlavour, GivesTheSameMeshAndSets) {
  const MeshFile sample = test::sample_mesh(3);
  const auto file = write(GetParam().write(sample));
  const MeshFile result = read_mesh(file);
  EXPECT_TRUE(test::same_mesh(result.mesh, sample.mesh));
  EXPECT_EQ(result.tet_sets, GetParam().sets(sample));
  EXPECT_THAT(result.files, testing::ElementsAre(file));
  MeshFile checked = result;
  EXPECT_NO_THROW(check_mesh(checked.mesh, file.string(), {}));
}

TEST_P(EachFlavour, IsReadInAnyLocale) {
  const MeshFile sample = test::sample_mesh(1);
  const auto file = write(GetParam().write(sample));
  const test::DecimalComma comma;
  const MeshFile result = read_mesh(file);
  EXPECT_TRUE(test::same_mesh(result.mesh, sample.mesh));
}

TEST_P(EachFlavour, IsRefusedAtEveryTruncation) {
  const MeshFile sample = test::sample_mesh(1);
  const std::string whole = GetParam().write(sample);
  std::size_t accepted = 0;
  for (std::size_t length = 0; length < whole.size(); ++length) {
    const auto file = write(std::string_view(whole).substr(0, length));
    try {
      const MeshFile result = read_mesh(file);
      ++accepted;
      EXPECT_TRUE(test::same_mesh(result.mesh, sample.mesh)) << "cut to " << length << " bytes";
    } catch (const InputError& error) {
      EXPECT_EQ(error.complaint().file, file.string());
      EXPECT_FALSE(error.complaint().expected.empty());
    }
  }
  // A .msh or a .mesh without its last line end is whole; a .veg may end after any section that follows the tets, a
  // .vtk before and after each of its data, with and without a line end, and after the lines that begin them. As text
  // also after any digit of the last number of its data.
  constexpr std::size_t kDigits = 24;
  const std::size_t in_number = whole.find("ASCII") != std::string::npos ? kDigits : 0;
  const std::map<std::string, std::size_t> optional{
      {".msh", 1}, {".mesh", 1}, {".veg", whole.size() - whole.find("*SET") + 2}, {".vtk", 7 + in_number}};
  const std::size_t optional_bytes = optional.at(GetParam().extension);
  EXPECT_LE(accepted, optional_bytes);
  EXPECT_GE(accepted, 1U);
}

TEST_P(EachFlavour, IsReadOrRefusedWithAnyByteChanged) {
  const MeshFile sample = test::sample_mesh(1);
  const std::string whole = GetParam().write(sample);
  std::mt19937 random(7);
  for (int trial = 0; trial < 1000; ++trial) {
    std::string bytes = whole;
    for (int change = 0; change < 1 + trial % 3; ++change)
      bytes[random() % bytes.size()] =
          trial % 2 == 0 ? static_cast<char>(random()) : "0123456789-.$*\n "[random() % 16];
    const auto file = write(bytes);
    try {
      MeshFile result = read_mesh(file);
      check_mesh(result.mesh, file.string(), {true, true, true});
    } catch (const InputError& error) {
      EXPECT_EQ(error.complaint().file.find(file.parent_path().string()), 0U);
    }
  }
}

TEST_P(EachFlavour, RefusesBytesAfterTheEnd) {
  const auto file = write(GetParam().write(test::sample_mesh(1)) + "stray 1 2 3\n");
  const Complaint complaint = complaint_of_reading(file);
  EXPECT_THAT(complaint.found, HasSubstr("'stray"));
  EXPECT_FALSE(complaint.place.empty());
}

INSTANTIATE_TEST_SUITE_P(Mesh, EachFlavour, testing::ValuesIn(test::flavours()),
                         [](const auto& param) { return param.param.name; });

TEST(ReadMesh, TakesWindowsLineEnds) {
  const TemporaryFolder folder;
  const MeshFile sample = test::sample_mesh(1);
  for (const auto& flavour : test::flavours()) {
    std::string text = flavour.write(sample);
    const bool is_binary = text.find('\0') != std::string::npos;
    if (is_binary) continue;
    for (std::size_t i = text.find('\n'); i != std::string::npos; i = text.find('\n', i + 2)) text.insert(i, "\r");
    const MeshFile result = read_mesh(folder.write(flavour.name + flavour.extension, text));
    EXPECT_TRUE(test::same_mesh(result.mesh, sample.mesh));
    EXPECT_EQ(result.tet_sets, flavour.sets(sample));
  }
}

}  // namespace
}  // namespace exmat::precompute
