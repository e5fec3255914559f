#include "common/surface_io/value_cursor.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <limits>

#include "common/core/error.h"
#include "common/surface_io/text_input.h"

namespace exmat {
namespace {

constexpr std::string_view kBlanks = " \t\r";
constexpr std::string_view kBlanksAndLineEnds = " \t\r\n";

}  // namespace

ValueCursor::ValueCursor(std::string file, std::string_view bytes, Layout layout, char comment)
    : file_(std::move(file)), bytes_(bytes), layout_(layout), comment_(comment) {}

void ValueCursor::set_binary(bool swap) {
  binary_ = true;
  swap_ = swap;
}

std::int32_t ValueCursor::read_int(std::string_view what) {
  if (binary_) return read_binary<std::int32_t>(what);
  using Limits = std::numeric_limits<std::int32_t>;
  const std::string_view word = read_word();
  const auto value = parse_integer(word);
  if (!value || *value < Limits::min() || *value > Limits::max()) fail(std::string(what), describe(word));
  return static_cast<std::int32_t>(*value);
}

std::uint64_t ValueCursor::read_size(std::string_view what) {
  if (binary_) return read_binary<std::uint64_t>(what);
  const std::string_view word = read_word();
  const auto value = parse_integer(word);
  if (!value || *value < 0) fail(std::string(what), describe(word));
  return static_cast<std::uint64_t>(*value);
}

double ValueCursor::read_real(std::string_view what) {
  if (!binary_) {
    const std::string_view word = read_word();
    const auto value = parse_real(word);
    if (!value) fail(fmt::format("{}, a finite number", what), describe(word), advice_for_number(word));
    return *value;
  }
  const double value = read_binary<double>(what);
  if (!std::isfinite(value)) fail(fmt::format("{}, a finite number", what), fmt::format("{}", value));
  return value;
}

std::uint64_t ValueCursor::read_count(std::string_view what, std::size_t min_text_bytes, std::size_t min_binary_bytes) {
  const std::uint64_t count = read_size(fmt::format("the number of {}", what));
  check_count(count, what, binary_ ? min_binary_bytes : min_text_bytes);
  return count;
}

std::uint64_t ValueCursor::read_text_count(std::string_view what, std::size_t min_text_bytes,
                                           std::size_t min_binary_bytes) {
  const std::string_view line = read_text_line(fmt::format("the number of {}", what));
  const auto count = parse_integer(line);
  if (!count || *count < 0) fail(fmt::format("the number of {}", what), describe(line));
  check_count(static_cast<std::uint64_t>(*count), what, binary_ ? min_binary_bytes : min_text_bytes);
  return static_cast<std::uint64_t>(*count);
}

std::string_view ValueCursor::read_text_line(std::string_view what) {
  last_ = std::min(bytes_.find_first_not_of(kBlanks, offset_), bytes_.size());
  const std::size_t end = bytes_.find('\n', offset_);
  // The last line of a text needs no line end.
  if (end == std::string_view::npos && (binary_ || last_ >= bytes_.size()))
    fail(std::string(what), "the end of the file");
  const std::string_view line = bytes_.substr(offset_, end - offset_);
  offset_ = std::min(end, bytes_.size() - 1) + 1;
  return trimmed(line);
}

void ValueCursor::fail(const std::string& expected, const std::string& found, const std::string& advice) const {
  fail_at(last_, expected, found, advice);
}

void ValueCursor::fail_at(std::size_t offset, const std::string& expected, const std::string& found,
                          const std::string& advice) const {
  const auto line_ends = std::count(bytes_.begin(), bytes_.begin() + static_cast<std::ptrdiff_t>(offset), '\n');
  const std::string place = binary_ ? fmt::format("byte {}", offset) : fmt::format("line {}", line_ends + 1);
  throw InputError({file_, place, expected, found, advice});
}

void ValueCursor::skip_blank_lines() {
  offset_ = std::min(bytes_.find_first_not_of(kBlanksAndLineEnds, offset_), bytes_.size());
}

void ValueCursor::skip_blanks() {
  const std::string_view blanks = layout_ == Layout::kLine ? kBlanks : kBlanksAndLineEnds;
  while (true) {
    offset_ = std::min(bytes_.find_first_not_of(blanks, offset_), bytes_.size());
    if (comment_ == '\0' || offset_ >= bytes_.size() || bytes_[offset_] != comment_) return;
    offset_ = std::min(bytes_.find('\n', offset_), bytes_.size());
  }
}

bool ValueCursor::at_end() const {
  return bytes_.find_first_not_of(kBlanksAndLineEnds, offset_) == std::string_view::npos;
}

void ValueCursor::finish_line() {
  const std::string_view extra = read_word();
  if (!extra.empty()) fail("the end of the line", quote(extra));
  if (offset_ < bytes_.size()) ++offset_;
}

std::string_view ValueCursor::read_word() {
  skip_blanks();
  last_ = offset_;
  const std::size_t length = std::min(rest().find_first_of(kBlanksAndLineEnds), rest().size());
  offset_ += length;
  return bytes_.substr(last_, length);
}

std::string ValueCursor::describe(std::string_view word) const {
  return word.empty() && last_ >= bytes_.size() ? "the end of the file" : quote(word);
}

std::string_view ValueCursor::read_bytes(std::uint64_t count, std::string_view what) {
  last_ = offset_;
  if (rest().size() < count) fail(std::string(what), "the end of the file");
  offset_ += count;
  return bytes_.substr(last_, count);
}

template <typename Number>
Number ValueCursor::read_binary(std::string_view what) {
  const std::string_view bytes = read_bytes(sizeof(Number), what);
  std::array<char, sizeof(Number)> raw{};
  std::memcpy(raw.data(), bytes.data(), sizeof(Number));
  if (swap_) std::reverse(raw.begin(), raw.end());
  Number value;
  std::memcpy(&value, raw.data(), sizeof(Number));
  return value;
}

template std::int8_t ValueCursor::read_binary(std::string_view);
template std::uint8_t ValueCursor::read_binary(std::string_view);
template std::int16_t ValueCursor::read_binary(std::string_view);
template std::uint16_t ValueCursor::read_binary(std::string_view);
template std::int32_t ValueCursor::read_binary(std::string_view);
template std::uint32_t ValueCursor::read_binary(std::string_view);
template std::int64_t ValueCursor::read_binary(std::string_view);
template std::uint64_t ValueCursor::read_binary(std::string_view);
template float ValueCursor::read_binary(std::string_view);
template double ValueCursor::read_binary(std::string_view);

void ValueCursor::check_values(std::uint64_t count, const NumberType& type, std::string_view what) const {
  // The last number of a text needs no blank after it.
  if (is_binary() && type.kind == NumberType::Kind::kBits)
    check_count(count / 8, what, 1);
  else
    check_count(count, what, is_binary() ? type.bytes : 1);
}

double ValueCursor::read_real_of(const NumberType& type, std::string_view what) {
  if (type.kind != NumberType::Kind::kReal) return static_cast<double>(read_integer_of(type, what));
  if (!is_binary()) {
    return read_real(what);
  }
  if (type.bytes == 8) return read_real(what);
  const double value = static_cast<double>(read_binary<float>(what));
  if (!std::isfinite(value)) fail(fmt::format("{}, a finite number", what), fmt::format("{}", value));
  return value;
}

std::int64_t ValueCursor::read_integer_of(const NumberType& type, std::string_view what) {
  if (!is_binary()) {
    const std::string_view word = read_word();
    const auto value = parse_integer(word);
    if (!value) fail(std::string(what), describe(word));
    return *value;
  }
  const bool is_signed = type.kind == NumberType::Kind::kSigned;
  if (type.bytes == 1) return is_signed ? read_binary<std::int8_t>(what) : read_binary<std::uint8_t>(what);
  if (type.bytes == 2) return is_signed ? read_binary<std::int16_t>(what) : read_binary<std::uint16_t>(what);
  if (type.bytes == 4)
    return is_signed ? std::int64_t{read_binary<std::int32_t>(what)} : std::int64_t{read_binary<std::uint32_t>(what)};
  return read_binary<std::int64_t>(what);
}

void ValueCursor::skip_values(std::uint64_t count, const NumberType& type, std::string_view what) {
  check_values(count, type, what);
  if (is_binary()) {
    read_bytes(type.kind == NumberType::Kind::kBits ? (count + 7) / 8 : count * type.bytes, what);
    return;
  }
  for (std::uint64_t k = 0; k < count; ++k)
    if (const auto word = read_word(); word.empty()) fail(std::string(what), describe(word));
}

void ValueCursor::check_count(std::uint64_t count, std::string_view what, std::size_t min_bytes) const {
  constexpr std::uint64_t kMaxCount = std::numeric_limits<std::int32_t>::max();
  const std::uint64_t limit = std::min<std::uint64_t>(rest().size() / min_bytes, kMaxCount);
  if (count > limit)
    fail(fmt::format("at most {} {}, which the rest of the file can hold", limit, what), fmt::format("{}", count));
}

}  // namespace exmat
