#include "precompute/mesh_io/msh_cursor.h"

#include <fmt/format.h>

namespace exmat::precompute {

std::string_view MshCursor::begin_section() {
  skip_blank_lines();
  const std::string_view word = read_word();
  if (word.empty()) return {};
  if (word[0] != '$' || word.size() == 1 || word.starts_with("$End"))
    fail("a section that begins with '$'", describe(word));
  finish_line();
  return word.substr(1);
}

void MshCursor::end_section(std::string_view name) {
  skip_blank_lines();
  const std::string_view word = read_word();
  if (word.starts_with("$End") && word.substr(4) == name) return;
  fail(fmt::format("$End{}", name), describe(word), "check the counts that the section declares");
}

void MshCursor::skip_section(std::string_view name) {
  const std::size_t end = find(fmt::format("$End{}", name));
  if (end == std::string_view::npos)
    fail_at(last_offset(), fmt::format("$End{} after ${}", name, name), "the end of the file");
  move_to(end);
}

void MshCursor::begin_record() {
  if (!is_binary()) skip_blank_lines();
}

void MshCursor::skip_ints(std::uint64_t count, std::string_view what) {
  for (std::uint64_t i = 0; i < count; ++i) read_int(what);
}

void MshCursor::skip_sizes(std::uint64_t count, std::string_view what) {
  for (std::uint64_t i = 0; i < count; ++i) read_size(what);
}

}  // namespace exmat::precompute
