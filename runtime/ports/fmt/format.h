#pragma once

#include <algorithm>
#include <charconv>
#include <cmath>
#include <concepts>
#include <cstdio>
#include <cstdlib>
#include <iterator>
#include <string>
#include <string_view>
#include <type_traits>

// The part of {fmt} that messages of the library use, for builds that have no library beside Eigen: {} and, of numbers,
// the flags, width, precision and type of printf, as in {:.3g}. Programs use {fmt} itself.

namespace fmt {

/// The elements from `first` to `last` with a text between them.
template <typename Iterator>
struct JoinView {
  Iterator first, last;
  std::string_view separator;
};

namespace detail {

/// Appends the fewest digits that are read back as `value`. Not by std::to_chars, whose tables for numbers take 105 kB
/// of a module of WebAssembly, which do not compress.
template <std::floating_point Value>
void append_shortest(std::string& text, Value value) {
  char buffer[64];
  double read = value;
  int digits = 1;
  for (;; ++digits) {
    std::snprintf(buffer, sizeof buffer, "%.*g", digits, static_cast<double>(value));
    read = std::strtod(buffer, nullptr);
    if (static_cast<Value>(read) == value || digits == 17) break;
  }
  // Numbers of up to 16 digits before the point have no exponent.
  const double size = std::abs(read);
  const int places = size >= 1 && size < 1e16 ? static_cast<int>(std::floor(std::log10(size))) + 1 : 0;
  const int length = size < 1e16 ? std::snprintf(buffer, sizeof buffer, "%.*g", std::max(digits, places), read)
                                 : std::snprintf(buffer, sizeof buffer, "%.*e", digits - 1, read);
  text.append(buffer, static_cast<std::size_t>(length));
}

template <typename Value>
void append(std::string& text, std::string_view spec, const Value& value) {
  if constexpr (std::same_as<Value, char>) {
    text += value;
  } else if constexpr (std::same_as<Value, bool>) {
    text += value ? "true" : "false";
  } else if constexpr (std::is_arithmetic_v<Value>) {
    char buffer[64];
    if (spec.empty()) {
      if constexpr (std::is_integral_v<Value>)
        text.append(buffer, std::to_chars(buffer, buffer + sizeof buffer, value).ptr);
      else
        append_shortest(text, value);
      return;
    }
    std::string pattern = "%" + std::string(spec.substr(spec[0] == '<' || spec[0] == '>' ? 1 : 0));
    if constexpr (std::is_integral_v<Value>) {
      const bool has_type = pattern.back() == 'x' || pattern.back() == 'd';
      const char type = has_type ? pattern.back() : 'd';
      if (has_type) pattern.pop_back();
      pattern += std::string("ll") + type;
      text.append(buffer, static_cast<std::size_t>(
                              std::snprintf(buffer, sizeof buffer, pattern.c_str(), static_cast<long long>(value))));
    } else {
      text.append(buffer, static_cast<std::size_t>(
                              std::snprintf(buffer, sizeof buffer, pattern.c_str(), static_cast<double>(value))));
    }
  } else {
    text += std::string_view(value);
  }
}

template <typename Iterator>
void append(std::string& text, std::string_view spec, const JoinView<Iterator>& view) {
  for (Iterator at = view.first; at != view.last; ++at) {
    if (at != view.first) text += view.separator;
    append(text, spec, *at);
  }
}

// Copies up to the next field, whose spec it returns and takes from the pattern.
inline std::string_view next_field(std::string& text, std::string_view& pattern) {
  while (!pattern.empty() && (pattern[0] != '{' || pattern.starts_with("{{"))) {
    text += pattern[0];
    pattern.remove_prefix(pattern.starts_with("{{") || pattern.starts_with("}}") ? 2 : 1);
  }
  const std::size_t end = pattern.find('}');
  if (end == std::string_view::npos) return {};
  const std::string_view field = pattern.substr(1, end - 1);
  pattern.remove_prefix(end + 1);
  return field.substr(field.starts_with(':') ? 1 : 0);
}

}  // namespace detail

template <typename... Values>
std::string format(std::string_view pattern, const Values&... values) {
  std::string text;
  (detail::append(text, detail::next_field(text, pattern), values), ...);
  detail::next_field(text, pattern);
  return text;
}

template <typename Iterator>
JoinView<Iterator> join(Iterator first, Iterator last, std::string_view separator) {
  return {first, last, separator};
}

template <typename Range>
auto join(const Range& range, std::string_view separator) {
  return join(std::begin(range), std::end(range), separator);
}

}  // namespace fmt
