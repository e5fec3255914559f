#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace exmat {

/// The bytes of a regular, non-empty file. Throws InputError that says `expected` where it is missing, a folder, a
/// pipe, a device, unreadable, empty, or an output of the running command (common/core/command_files.h).
std::string read_whole_file(const std::filesystem::path& file, const std::string& expected);

/// Reads a file that is text, or begins with text, likewise: without a byte order mark, and with '\n' for line ends
/// that are '\r' alone. Throws InputError where the text is UTF-16.
std::string read_text_file(const std::filesystem::path& file, const std::string& expected);

/// The kind of `file`, which begins with these bytes, for messages: "an HDF5 file"; empty where it is of no known one.
/// Its extension decides where the bytes say nothing.
std::string_view kind_of_file(const std::filesystem::path& file, std::string_view bytes);

/// Refuses a mesh or a surface, by its extension, that begins as a file of another kind. What cannot be read passes.
void refuse_other_kind(const std::filesystem::path& file);

/// The kind of all that begins as a JSON object does.
inline constexpr std::string_view kJson = "a JSON file (a scene or an asset?)";

/// The extension in lower case, with its point: ".obj" of "A.OBJ".
std::string lower_extension(const std::filesystem::path& file);

/// Advice that turns a file of another kind, by its extension, into a mesh: "export it as .glb, ..."; empty: not known.
std::string way_from(const std::filesystem::path& file);

/// Refuses a file whose extension is none of those expected, with `advice` or the way to one of them where it is known.
[[noreturn]] void refuse_extension(const std::filesystem::path& file, const std::string& expected,
                                   const std::string& advice = "");

}  // namespace exmat
