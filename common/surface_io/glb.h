#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace exmat {

/// The chunks of a binary glTF file.
struct GlbParts {
  std::string_view json;
  std::optional<std::string_view> buffer;
};

/// True if the bytes begin as a binary glTF file does.
bool is_glb(std::string_view bytes);

/// The chunks of a .glb; those of other kinds are left out. They are views of `bytes`. Throws InputError with the byte.
GlbParts parts_of_glb(const std::string& file, std::string_view bytes);

/// A .glb of these chunks, each padded to four bytes; without a second one where the buffer is empty.
std::string to_glb(std::string_view json, std::string_view buffer);

}  // namespace exmat
