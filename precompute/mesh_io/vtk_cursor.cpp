#include "precompute/mesh_io/vtk_cursor.h"

#include <fmt/format.h>
#include <utility>

#include "common/surface_io/text_input.h"

namespace exmat::precompute {
namespace {

using Kind = NumberType::Kind;

// Types of fixed size, and the C types of a 64-bit machine. VTK writes its vtkIdType as 32 bits.
constexpr std::array<std::pair<std::string_view, NumberType>, 15> kTypes{{{"bit", {Kind::kBits, 1}},
                                                                          {"char", {Kind::kSigned, 1}},
                                                                          {"signed_char", {Kind::kSigned, 1}},
                                                                          {"unsigned_char", {Kind::kUnsigned, 1}},
                                                                          {"short", {Kind::kSigned, 2}},
                                                                          {"unsigned_short", {Kind::kUnsigned, 2}},
                                                                          {"int", {Kind::kSigned, 4}},
                                                                          {"unsigned_int", {Kind::kUnsigned, 4}},
                                                                          {"vtkIdType", {Kind::kSigned, 4}},
                                                                          {"long", {Kind::kSigned, 8}},
                                                                          {"vtktypeint64", {Kind::kSigned, 8}},
                                                                          {"unsigned_long", {Kind::kUnsigned, 8}},
                                                                          {"vtktypeuint64", {Kind::kUnsigned, 8}},
                                                                          {"float", {Kind::kReal, 4}},
                                                                          {"double", {Kind::kReal, 8}}}};

}  // namespace

VtkCursor::Words VtkCursor::read_keywords() {
  while (!at_end()) {
    skip_blank_lines();
    Fields fields(read_text_line("a line of keywords"));
    Words words;
    for (auto& word : words) word = fields.next();
    if (words[0] != "METADATA") return words;
    // It ends with a blank line.
    while (!at_end() && !read_text_line("a line of METADATA").empty()) continue;
  }
  return {};
}

std::uint64_t VtkCursor::number(std::string_view word, std::string_view what) const {
  const auto value = parse_integer(word);
  if (!value || *value < 0) fail(fmt::format("the number of {}", what), quote(word));
  return static_cast<std::uint64_t>(*value);
}

NumberType VtkCursor::type(std::string_view name) const {
  for (const auto& [known, type] : kTypes)
    if (known == name) return type;
  fail("a type of numbers, such as 'int' or 'double'", quote(name), "leave arrays of strings out");
}

}  // namespace exmat::precompute
