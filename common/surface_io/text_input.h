#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

namespace exmat {

/// The bytes of a regular, non-empty file. Throws InputError that says `expected` where it is missing, unreadable or
/// empty.
std::string read_whole_file(const std::filesystem::path& file, const std::string& expected);

/// The fields of one line, separated by blanks or commas.
class Fields {
 public:
  explicit Fields(std::string_view line) : rest_(line) {}

  /// The next field; empty at the end of the line.
  std::string_view next();

 private:
  std::string_view rest_;
};

/// The whole field as a finite number; empty where it is none or out of range. Independent of the locale.
std::optional<double> parse_real(std::string_view field);

/// The whole field as an integer; empty where it is none or out of range.
std::optional<std::int64_t> parse_integer(std::string_view field);

/// Without the blanks around it.
std::string_view trimmed(std::string_view text);

/// For a message: in quotes, shortened, printable; "the end of the line" where it is empty.
std::string quote(std::string_view text);

}  // namespace exmat
