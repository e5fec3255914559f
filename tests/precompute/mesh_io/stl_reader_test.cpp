#include "common/surface_io/stl_reader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/precompute/mesh_io/gltf_samples.h"
#include "tests/precompute/mesh_io/mesh_samples.h"

namespace exmat::precompute {
namespace stl_reader_test {

using test::complaint_of;
using test::edited;
using test::gltf_bytes;
using test::TemporaryFolder;
using testing::HasSubstr;

constexpr auto kText = R"(solid left half
facet normal 0 0 1
  outer loop
    vertex 0 0 0
    vertex 1 0 0
    vertex 1 1 0
  endloop
endfacet
endsolid left half
SOLID right
FACET NORMAL 0 0 1 OUTER LOOP VERTEX 0 -0 0 VERTEX 1 1.0 0 VERTEX 0 1e0 0 ENDLOOP ENDFACET
ENDSOLID right
)";

std::string binary(std::uint32_t count, const std::vector<double>& corners) {
  std::string bytes(80, ' ');
  bytes += gltf_bytes(test::kUnsignedInt, {static_cast<double>(count)});
  for (std::size_t k = 0; k < corners.size(); k += 9) {
    bytes += gltf_bytes(test::kFloat, {0, 0, 0});
    bytes += gltf_bytes(test::kFloat, {corners.begin() + static_cast<std::ptrdiff_t>(k),
                                       corners.begin() + static_cast<std::ptrdiff_t>(k + 9)});
    bytes += "ab";
  }
  return bytes;
}

TEST(ReadStl, MergesEqualCornersAndNamesSolids) {
  const TemporaryFolder folder;
  const auto file = folder.write("a.stl", kText);
  const SurfaceFile surface = read_stl(file);
  EXPECT_EQ(surface.mesh.vertices, (VertexArray(4, 3) << 0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0).finished());
  EXPECT_EQ(surface.mesh.triangles, (TriangleArray(2, 3) << 0, 1, 2, 0, 2, 3).finished());
  EXPECT_THAT(surface.files, testing::ElementsAre(file));
  EXPECT_EQ(surface.parts.at("left half"), (FlagVector(4) << 1, 1, 1, 0).finished());
  EXPECT_EQ(surface.parts.at("right"), (FlagVector(4) << 1, 0, 1, 1).finished());
}

TEST(ReadStl, MergesNegativeZeroOfABinaryFile) {
  const TemporaryFolder folder;
  const SurfaceFile surface =
      read_stl(folder.write("a.stl", binary(2, {0, 0, 0, 1, 0, 0, 1, 1, 0, -0.0, 0, 0, 1, 1, 0, 0, 1, 0})));
  EXPECT_EQ(surface.mesh.vertices.rows(), 4);
  EXPECT_EQ(surface.mesh.triangles, (TriangleArray(2, 3) << 0, 1, 2, 0, 2, 3).finished());
}

struct Malformed {
  const char *name, *from, *to, *place, *expected, *found;
};

void PrintTo(const Malformed& malformed, std::ostream* stream) { *stream << malformed.name; }

class RefusesStl : public testing::TestWithParam<Malformed> {};

TEST_P(RefusesStl, WithPlaceExpectedAndFound) {
  const TemporaryFolder folder;
  const auto file = folder.write("bad.stl", edited(kText, GetParam().from, GetParam().to));
  const auto complaint = complaint_of([&] { read_stl(file); });
  EXPECT_EQ(complaint.file, file.string());
  EXPECT_EQ(complaint.place, GetParam().place);
  EXPECT_THAT(complaint.expected, HasSubstr(GetParam().expected));
  EXPECT_THAT(complaint.found, HasSubstr(GetParam().found));
}

constexpr std::array kMalformed{
    Malformed{"NoFacet", "facet normal 0 0 1\n", "face normal 0 0 1\n", "line 2", "'facet' or 'endsolid'", "'face'"},
    Malformed{"NoLoop", "  outer loop", "  outer circle", "line 3", "'loop'", "'circle'"},
    Malformed{"NanCoordinate", "vertex 1 0 0", "vertex 1 nan 0", "line 5", "a coordinate, a finite number", "'nan'"},
    Malformed{"TwoCorners", "    vertex 1 0 0\n", "", "line 6", "'vertex'", "'endloop'"},
    Malformed{"NoEnd", "ENDSOLID right\n", "", "line 12", "'facet' or 'endsolid'", "the end of the file"},
    Malformed{"TextAfterIt", "SOLID right\nFACET", "right\nFACET", "line 10", "'solid'", "'right'"},
};

INSTANTIATE_TEST_SUITE_P(Malformed, RefusesStl, testing::ValuesIn(kMalformed),
                         [](const auto& param) { return std::string(param.param.name); });

TEST(ReadStl, RefusesBinaryFilesOfAnotherSizeOrWithoutNumbers) {
  const TemporaryFolder folder;
  const std::vector<double> corners{0, 0, 0, 1, 0, 0, 1, 1, 0};
  const auto refused = [&](const std::string& bytes) {
    const auto file = folder.write("bad.stl", bytes);
    return complaint_of([&] { read_stl(file); });
  };
  EXPECT_EQ(refused(binary(1, corners) + "x").expected, "a file of 134 bytes, as its 1 triangles take");
  EXPECT_THAT(refused(binary(4294967295U, corners)).expected, HasSubstr("at most 1 triangles"));
  EXPECT_EQ(refused(binary(0, {})).expected, "triangles");
  EXPECT_THAT(refused(binary(1, {0, 0, 0, 1, 0, INFINITY, 1, 1, 0})).expected, HasSubstr("a finite number"));
  EXPECT_EQ(refused("binary").expected, "a header of 80 bytes");
}

}  // namespace stl_reader_test
}  // namespace exmat::precompute
