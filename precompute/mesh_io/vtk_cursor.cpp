#include "precompute/mesh_io/vtk_cursor.h"

#include <cmath>
#include <fmt/format.h>
#include <utility>

#include "precompute/mesh_io/text_input.h"

namespace exmat::precompute {
namespace {

using Kind = VtkType::Kind;

// Types of fixed size, and the C types of a 64-bit machine. VTK writes its vtkIdType as 32 bits.
constexpr std::array<std::pair<std::string_view, VtkType>, 15> kTypes{{{"bit", {Kind::kBits, 1}},
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

VtkType VtkCursor::type(std::string_view name) const {
  for (const auto& [known, type] : kTypes)
    if (known == name) return type;
  fail("a type of numbers, such as 'int' or 'double'", quote(name), "leave arrays of strings out");
}

void VtkCursor::check_values(std::uint64_t count, const VtkType& type, std::string_view what) const {
  // The last number of a text needs no blank after it.
  if (is_binary() && type.kind == Kind::kBits)
    check_count(count / 8, what, 1);
  else
    check_count(count, what, is_binary() ? type.bytes : 1);
}

double VtkCursor::read_real_of(const VtkType& type, std::string_view what) {
  if (type.kind != Kind::kReal) return static_cast<double>(read_integer_of(type, what));
  if (!is_binary()) {
    const double value = read_real(what);
    refuse_cut();
    return value;
  }
  if (type.bytes == 8) return read_real(what);
  const double value = static_cast<double>(read_binary<float>(what));
  if (!std::isfinite(value)) fail(fmt::format("{}, a finite number", what), fmt::format("{}", value));
  return value;
}

std::int64_t VtkCursor::read_integer_of(const VtkType& type, std::string_view what) {
  if (!is_binary()) {
    const std::string_view word = read_word();
    const auto value = parse_integer(word);
    if (!value) fail(std::string(what), describe(word));
    refuse_cut();
    return *value;
  }
  const bool is_signed = type.kind == Kind::kSigned;
  if (type.bytes == 1) return is_signed ? read_binary<std::int8_t>(what) : read_binary<std::uint8_t>(what);
  if (type.bytes == 2) return is_signed ? read_binary<std::int16_t>(what) : read_binary<std::uint16_t>(what);
  if (type.bytes == 4)
    return is_signed ? std::int64_t{read_binary<std::int32_t>(what)} : std::int64_t{read_binary<std::uint32_t>(what)};
  return read_binary<std::int64_t>(what);
}

void VtkCursor::skip_values(std::uint64_t count, const VtkType& type, std::string_view what) {
  check_values(count, type, what);
  if (is_binary()) {
    read_bytes(type.kind == Kind::kBits ? (count + 7) / 8 : count * type.bytes, what);
    return;
  }
  for (std::uint64_t k = 0; k < count; ++k)
    if (const auto word = read_word(); word.empty()) fail(std::string(what), describe(word));
  if (count > 0) refuse_cut();
}

// A number that ends with the file may have had more digits.
void VtkCursor::refuse_cut() const {
  if (exhausted()) fail("a line end after the last number", "the end of the file", "is the file cut off?");
}

}  // namespace exmat::precompute
