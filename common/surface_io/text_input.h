#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace exmat {

/// The fields of one line, separated by blanks or, unless they are told not to be, by commas.
class Fields {
 public:
  enum class Separators { kBlanksAndCommas, kBlanks };
  explicit Fields(std::string_view line, Separators separators = Separators::kBlanksAndCommas)
      : rest_(line), separators_(separators) {}

  /// The next field; empty at the end of the line.
  std::string_view next();

 private:
  std::string_view rest_;
  Separators separators_;
};

/// The whole field as a finite number; empty where it is none or out of range. Independent of the locale.
std::optional<double> parse_real(std::string_view field);

/// The whole field as an integer; empty where it is none or out of range.
std::optional<std::int64_t> parse_integer(std::string_view field);

/// Advice for a field that is no number for its decimal comma; else empty.
std::string advice_for_number(std::string_view field);

/// Without the blanks around it.
std::string_view trimmed(std::string_view text);

/// For a message: in quotes, shortened, printable; "the end of the line" where it is empty.
std::string quote(std::string_view text);

}  // namespace exmat
