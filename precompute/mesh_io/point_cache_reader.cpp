#include <bit>
#include <fmt/format.h>

#include "common/core/error.h"
#include "common/core/input_file.h"
#include "common/surface_io/text_input.h"
#include "common/surface_io/value_cursor.h"
#include "precompute/mesh_io/surface_file.h"

namespace exmat::precompute {
namespace {

constexpr std::string_view kCacheMagic("POINTCACHE2\0", 12);
constexpr std::size_t kPointBytes = 3 * sizeof(float);

struct CacheHeader {
  std::int32_t vertices = 0, frames = 0;
};

CacheHeader read_header(ValueCursor& cursor) {
  if (const auto magic = cursor.read_bytes(kCacheMagic.size(), "the first bytes of a point cache, 'POINTCACHE2'");
      magic != kCacheMagic)
    cursor.fail("the first bytes of a point cache, 'POINTCACHE2'", quote(magic), "is this a .pc2 file?");
  if (const auto version = cursor.read_int("the version"); version != 1)
    cursor.fail("version 1", std::to_string(version));
  CacheHeader header;
  header.vertices = cursor.read_int("the number of vertices");
  if (header.vertices < 1) cursor.fail("at least 1 vertex", std::to_string(header.vertices));
  cursor.read_bytes(2 * sizeof(float), "the first frame and the sample rate");
  header.frames = cursor.read_int("the number of frames");
  if (header.frames < 1) cursor.fail("at least 1 frame", std::to_string(header.frames));
  return header;
}

}  // namespace

VertexArray read_point_cache_frame(const std::filesystem::path& file, std::int64_t frame, Eigen::Index vertices) {
  const std::string bytes = read_whole_file(file, "a point cache (.pc2)");
  ValueCursor cursor(file.string(), bytes, ValueCursor::Layout::kAnywhere);
  cursor.set_binary(std::endian::native != std::endian::little);
  const CacheHeader header = read_header(cursor);
  if (header.vertices != vertices)
    throw InputError({file.string(), "", fmt::format("{} vertices, as the surface has", vertices),
                      std::to_string(header.vertices),
                      "export the cache from the mesh that the surface is of, without modifiers that add vertices"});
  if (frame < 0 || frame >= header.frames)
    throw InputError(
        {file.string(), "", fmt::format("frames from 0 to {}", header.frames - 1), std::to_string(frame), ""});
  const auto points = static_cast<std::uint64_t>(header.vertices);
  cursor.check_count(static_cast<std::uint64_t>(header.frames), "frames", points * kPointBytes);
  cursor.read_bytes(static_cast<std::uint64_t>(frame) * points * kPointBytes, "frames");
  VertexArray positions(vertices, 3);
  for (double& coordinate : positions.reshaped<Eigen::RowMajor>())
    coordinate = cursor.read_real_of({NumberType::Kind::kReal, sizeof(float)}, "a coordinate");
  return positions;
}

}  // namespace exmat::precompute
