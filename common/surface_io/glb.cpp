#include "common/surface_io/glb.h"

#include <bit>
#include <cstdint>
#include <fmt/format.h>

#include "common/surface_io/value_cursor.h"

namespace exmat {
namespace {

constexpr std::string_view kGlbMagic = "glTF";
constexpr std::uint32_t kGlbVersion = 2, kJsonChunk = 0x4E4F534A, kBinaryChunk = 0x004E4942;
constexpr std::size_t kGlbHeaderBytes = 12, kChunkHeaderBytes = 8;

void append_chunk(std::string& glb, std::uint32_t kind, std::string_view bytes, char padding) {
  const auto append = [&](std::uint32_t value) {
    for (int shift = 0; shift < 32; shift += 8) glb += static_cast<char>((value >> shift) & 0xffU);
  };
  const std::size_t padded = (bytes.size() + 3) / 4 * 4;
  append(static_cast<std::uint32_t>(padded));
  append(kind);
  glb += bytes;
  glb.append(padded - bytes.size(), padding);
}

}  // namespace

bool is_glb(std::string_view bytes) { return bytes.starts_with(kGlbMagic); }

GlbParts parts_of_glb(const std::string& file, std::string_view bytes) {
  ValueCursor cursor(file, bytes, ValueCursor::Layout::kAnywhere);
  cursor.set_binary(std::endian::native != std::endian::little);
  cursor.read_bytes(kGlbMagic.size(), "'glTF'");
  if (const auto version = cursor.read_binary<std::uint32_t>("the version"); version != kGlbVersion)
    cursor.fail("version 2", std::to_string(version), "export as glTF 2.0");
  const auto length = cursor.read_binary<std::uint32_t>("the length of the file");
  if (length != bytes.size())
    cursor.fail(fmt::format("a file of {} bytes", length), std::to_string(bytes.size()),
                length > bytes.size() ? "is the file cut off?" : "is the file damaged?");
  GlbParts parts;
  std::size_t end = kGlbHeaderBytes;
  while (end + kChunkHeaderBytes <= length) {
    const auto size = cursor.read_binary<std::uint32_t>("the length of a chunk");
    const auto kind = cursor.read_binary<std::uint32_t>("the kind of a chunk");
    if (parts.json.empty() && kind != kJsonChunk) cursor.fail("a chunk of JSON first", fmt::format("{:#x}", kind));
    const auto chunk = cursor.read_bytes(size, fmt::format("a chunk of {} bytes", size));
    if (kind == kJsonChunk && parts.json.empty()) parts.json = chunk;
    if (kind == kBinaryChunk && !parts.buffer) parts.buffer = chunk;
    end += kChunkHeaderBytes + std::size_t{size};
    if (parts.json.empty()) cursor.fail("JSON", "an empty chunk");
  }
  if (parts.json.empty()) cursor.fail("a chunk of JSON", "the end of the file");
  if (end < length)
    cursor.fail("the end of the file, or another chunk", fmt::format("{} bytes that are none", length - end),
                "is the file damaged?");
  return parts;
}

std::string to_glb(std::string_view json, std::string_view buffer) {
  std::string glb("glTF\2\0\0\0\0\0\0\0", kGlbHeaderBytes);
  glb.reserve(kGlbHeaderBytes + json.size() + buffer.size() + 24);
  append_chunk(glb, kJsonChunk, json, ' ');
  if (!buffer.empty()) append_chunk(glb, kBinaryChunk, buffer, '\0');
  for (std::size_t k = 0; k < 4; ++k) glb[8 + k] = static_cast<char>((glb.size() >> (8 * k)) & 0xffU);
  return glb;
}

}  // namespace exmat
