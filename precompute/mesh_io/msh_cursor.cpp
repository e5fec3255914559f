#include "precompute/mesh_io/msh_cursor.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <limits>

#include "common/core/error.h"
#include "precompute/mesh_io/text_input.h"

namespace exmat::precompute {
namespace {

constexpr std::string_view kBlanks = " \t\r";
constexpr std::string_view kBlanksAndLineEnds = " \t\r\n";

}  // namespace

MshCursor::MshCursor(std::string file, std::string_view bytes) : file_(std::move(file)), bytes_(bytes) {}

void MshCursor::set_binary(bool swap) {
  binary_ = true;
  swap_ = swap;
}

std::string_view MshCursor::begin_section() {
  offset_ = std::min(bytes_.find_first_not_of(kBlanksAndLineEnds, offset_), bytes_.size());
  const std::string_view word = read_word();
  if (word.empty()) return {};
  if (word[0] != '$' || word.size() == 1 || word.starts_with("$End"))
    fail("a section that begins with '$'", describe(word));
  finish_line();
  return word.substr(1);
}

void MshCursor::end_section(std::string_view name) {
  offset_ = std::min(bytes_.find_first_not_of(kBlanksAndLineEnds, offset_), bytes_.size());
  const std::string_view word = read_word();
  if (word.starts_with("$End") && word.substr(4) == name) return;
  fail(fmt::format("$End{}", name), describe(word), "check the counts that the section declares");
}

void MshCursor::skip_section(std::string_view name) {
  const std::size_t begin = last_;
  const std::size_t end = bytes_.find(fmt::format("$End{}", name), offset_);
  if (end == std::string_view::npos) fail_at(begin, fmt::format("$End{} after ${}", name, name), "the end of the file");
  offset_ = end;
}

void MshCursor::begin_record() {
  if (!binary_) offset_ = std::min(bytes_.find_first_not_of(kBlanksAndLineEnds, offset_), bytes_.size());
}

std::int32_t MshCursor::read_int(std::string_view what) {
  if (binary_) return read_raw<std::int32_t>(what);
  using Limits = std::numeric_limits<std::int32_t>;
  const std::string_view word = read_word();
  const auto value = parse_integer(word);
  if (!value || *value < Limits::min() || *value > Limits::max()) fail(std::string(what), describe(word));
  return static_cast<std::int32_t>(*value);
}

std::uint64_t MshCursor::read_size(std::string_view what) {
  if (binary_) return read_raw<std::uint64_t>(what);
  const std::string_view word = read_word();
  const auto value = parse_integer(word);
  if (!value || *value < 0) fail(std::string(what), describe(word));
  return static_cast<std::uint64_t>(*value);
}

double MshCursor::read_real(std::string_view what) {
  if (!binary_) {
    const std::string_view word = read_word();
    const auto value = parse_real(word);
    if (!value) fail(fmt::format("{}, a finite number", what), describe(word));
    return *value;
  }
  const double value = read_raw<double>(what);
  if (!std::isfinite(value)) fail(fmt::format("{}, a finite number", what), fmt::format("{}", value));
  return value;
}

void MshCursor::skip_ints(std::uint64_t count, std::string_view what) {
  for (std::uint64_t i = 0; i < count; ++i) read_int(what);
}

void MshCursor::skip_sizes(std::uint64_t count, std::string_view what) {
  for (std::uint64_t i = 0; i < count; ++i) read_size(what);
}

std::uint64_t MshCursor::read_count(std::string_view what, std::size_t min_text_bytes, std::size_t min_binary_bytes) {
  const std::uint64_t count = read_size(fmt::format("the number of {}", what));
  check_count(count, what, binary_ ? min_binary_bytes : min_text_bytes);
  return count;
}

std::uint64_t MshCursor::read_text_count(std::string_view what, std::size_t min_text_bytes,
                                         std::size_t min_binary_bytes) {
  const std::string_view line = read_text_line(fmt::format("the number of {}", what));
  const auto count = parse_integer(line);
  if (!count || *count < 0) fail(fmt::format("the number of {}", what), describe(line));
  check_count(static_cast<std::uint64_t>(*count), what, binary_ ? min_binary_bytes : min_text_bytes);
  return static_cast<std::uint64_t>(*count);
}

std::string_view MshCursor::read_text_line(std::string_view what) {
  last_ = std::min(bytes_.find_first_not_of(kBlanks, offset_), bytes_.size());
  const std::size_t end = bytes_.find('\n', offset_);
  if (end == std::string_view::npos) fail(std::string(what), "the end of the file");
  const std::string_view line = bytes_.substr(offset_, end - offset_);
  offset_ = end + 1;
  return trimmed(line);
}

void MshCursor::fail(const std::string& expected, const std::string& found, const std::string& advice) const {
  fail_at(last_, expected, found, advice);
}

void MshCursor::fail_at(std::size_t offset, const std::string& expected, const std::string& found,
                        const std::string& advice) const {
  const auto line_ends = std::count(bytes_.begin(), bytes_.begin() + static_cast<std::ptrdiff_t>(offset), '\n');
  const std::string place = binary_ ? fmt::format("byte {}", offset) : fmt::format("line {}", line_ends + 1);
  throw InputError({file_, place, expected, found, advice});
}

void MshCursor::finish_line() {
  const std::string_view extra = read_word();
  if (!extra.empty()) fail("the end of the line", quote(extra));
  if (offset_ < bytes_.size()) ++offset_;
}

// The next word of the line; empty at its end.
std::string_view MshCursor::read_word() {
  offset_ = std::min(bytes_.find_first_not_of(kBlanks, offset_), bytes_.size());
  last_ = offset_;
  const std::size_t length = std::min(rest().find_first_of(kBlanksAndLineEnds), rest().size());
  offset_ += length;
  return bytes_.substr(last_, length);
}

std::string MshCursor::describe(std::string_view word) const {
  return word.empty() && last_ >= bytes_.size() ? "the end of the file" : quote(word);
}

template <typename Number>
Number MshCursor::read_raw(std::string_view what) {
  last_ = offset_;
  if (rest().size() < sizeof(Number)) fail(std::string(what), "the end of the file");
  std::array<char, sizeof(Number)> raw{};
  std::memcpy(raw.data(), rest().data(), sizeof(Number));
  if (swap_) std::reverse(raw.begin(), raw.end());
  offset_ += sizeof(Number);
  Number value;
  std::memcpy(&value, raw.data(), sizeof(Number));
  return value;
}

void MshCursor::check_count(std::uint64_t count, std::string_view what, std::size_t min_bytes) const {
  constexpr std::uint64_t kMaxCount = std::numeric_limits<std::int32_t>::max();
  const std::uint64_t limit = std::min<std::uint64_t>(rest().size() / min_bytes, kMaxCount);
  if (count > limit)
    fail(fmt::format("at most {} {}, which the rest of the file can hold", limit, what), fmt::format("{}", count));
}

}  // namespace exmat::precompute
