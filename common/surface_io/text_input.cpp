#include "common/surface_io/text_input.h"

#include <algorithm>
#include <charconv>
#include <cmath>

namespace exmat {
namespace {

constexpr std::string_view kWhiteSpace = " \t\r\n\v\f";
constexpr std::string_view kSeparators = " \t\r\n\v\f,";

// from_chars knows no plus sign.
std::string_view without_plus(std::string_view field) {
  const bool signed_number = field.size() > 1 && field[0] == '+' && field[1] != '-' && field[1] != '+';
  return signed_number ? field.substr(1) : field;
}

template <typename Number>
std::optional<Number> parse_whole(std::string_view field) {
  field = without_plus(field);
  Number value{};
  const char* end = field.data() + field.size();
  const auto [stop, error] = std::from_chars(field.data(), end, value);
  if (error != std::errc{} || stop != end) return std::nullopt;
  return value;
}

}  // namespace

std::string_view Fields::next() {
  const std::string_view between = separators_ == Separators::kBlanks ? kWhiteSpace : kSeparators;
  const std::size_t begin = std::min(rest_.find_first_not_of(between), rest_.size());
  rest_.remove_prefix(begin);
  const std::size_t length = std::min(rest_.find_first_of(between), rest_.size());
  const std::string_view field = rest_.substr(0, length);
  rest_.remove_prefix(length);
  return field;
}

std::optional<double> parse_real(std::string_view field) {
  const auto value = parse_whole<double>(field);
  return value && std::isfinite(*value) ? value : std::nullopt;
}

std::optional<std::int64_t> parse_integer(std::string_view field) { return parse_whole<std::int64_t>(field); }

std::string advice_for_number(std::string_view field) {
  std::string pointed(field);
  std::ranges::replace(pointed, ',', '.');
  return pointed != field && parse_real(pointed) ? "write numbers with decimal points" : "";
}

std::string_view trimmed(std::string_view text) {
  const std::size_t begin = text.find_first_not_of(kWhiteSpace);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(kWhiteSpace) - begin + 1);
}

std::string quote(std::string_view text) {
  constexpr std::size_t kLongest = 40;
  if (text.empty()) return "the end of the line";
  std::string shown(text.substr(0, kLongest));
  std::replace_if(
      shown.begin(), shown.end(), [](unsigned char c) { return c < 0x20 || c > 0x7e; }, '?');
  return "'" + shown + (text.size() > kLongest ? "...'" : "'");
}

}  // namespace exmat
