#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace exmat {

/// CRC-32 of `bytes` as zlib and PNG have it (polynomial 0xedb88320, reflected), continued from `crc` (0 to begin).
std::uint32_t crc32_of(std::span<const std::byte> bytes, std::uint32_t crc = 0);

}  // namespace exmat
