#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <numeric>

#include "precompute/mesh_io/surface_file.h"
#include "tests/precompute/mesh_io/gltf_samples.h"
#include "tests/precompute/mesh_io/mesh_samples.h"

namespace exmat::precompute {
namespace {

using test::complaint_of;
using test::gltf_bytes;
using test::TemporaryFolder;
using testing::HasSubstr;

// Three frames of two points, whose coordinates count up.
std::string cache() {
  std::vector<double> coordinates(18);
  std::iota(coordinates.begin(), coordinates.end(), 0.5);
  return std::string("POINTCACHE2\0", 12) + gltf_bytes(test::kUnsignedInt, {1, 2}) + gltf_bytes(test::kFloat, {0, 1}) +
         gltf_bytes(test::kUnsignedInt, {3}) + gltf_bytes(test::kFloat, coordinates);
}

TEST(ReadPointCacheFrame, GivesEachFrame) {
  const TemporaryFolder folder;
  const auto file = folder.write("a.pc2", cache());
  for (int frame = 0; frame < 3; ++frame) {
    VertexArray expected(2, 3);
    std::iota(expected.data(), expected.data() + 6, 6 * frame + 0.5);
    EXPECT_EQ(read_point_cache_frame(file, frame, 2), expected);
  }
}

TEST(ReadPointCacheFrame, NamesFramesAndVerticesWhereTheyDiffer) {
  const TemporaryFolder folder;
  const auto file = folder.write("a.pc2", cache());
  for (const std::int64_t frame : {-1, 3}) {
    const auto complaint = complaint_of([&] { read_point_cache_frame(file, frame, 2); });
    EXPECT_EQ(complaint.expected, "frames from 0 to 2");
    EXPECT_EQ(complaint.found, std::to_string(frame));
  }
  const auto complaint = complaint_of([&] { read_point_cache_frame(file, 0, 5); });
  EXPECT_EQ(complaint.expected, "5 vertices, as the surface has");
  EXPECT_EQ(complaint.found, "2");
}

TEST(ReadPointCacheFrame, RefusesEveryTruncation) {
  const TemporaryFolder folder;
  const std::string whole = cache();
  for (std::size_t length = 0; length < whole.size(); ++length) {
    const auto file = folder.write("a.pc2", whole.substr(0, length));
    EXPECT_FALSE(complaint_of([&] { read_point_cache_frame(file, 0, 2); }).expected.empty()) << length;
  }
}

TEST(ReadPointCacheFrame, ReadsOrRefusesAnyChangedByte) {
  const TemporaryFolder folder;
  const std::string whole = cache();
  for (std::size_t k = 0; k < whole.size(); ++k)
    for (const char value : {'\0', '\x7f', '\xff'}) {
      std::string bytes = whole;
      bytes[k] = value;
      try {
        EXPECT_TRUE(read_point_cache_frame(folder.write("a.pc2", bytes), 0, 2).allFinite());
      } catch (const InputError& error) {
        EXPECT_FALSE(error.complaint().expected.empty());
      }
    }
}

TEST(ReadPointCacheFrame, RefusesOtherFiles) {
  const TemporaryFolder folder;
  const auto refused = [&](std::size_t byte, char value) {
    std::string bytes = cache();
    bytes[byte] = value;
    const auto file = folder.write("a.pc2", bytes);
    return complaint_of([&] { read_point_cache_frame(file, 0, 2); });
  };
  EXPECT_THAT(refused(0, 'X').expected, HasSubstr("'POINTCACHE2'"));
  EXPECT_EQ(refused(12, 2).expected, "version 1");
  EXPECT_EQ(refused(16, 0).expected, "at least 1 vertex");
  EXPECT_EQ(refused(28, 0).expected, "at least 1 frame");
  EXPECT_THAT(refused(30, 1).expected, HasSubstr("at most 3 frames"));
}

}  // namespace
}  // namespace exmat::precompute
