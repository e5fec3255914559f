#pragma once

#include <array>
#include <optional>
#include <string_view>

#include "precompute/mesh_io/value_cursor.h"

namespace exmat::precompute {

/// A type of number of a legacy .vtk file.
struct VtkType {
  enum class Kind { kSigned, kUnsigned, kReal, kBits };
  Kind kind;
  std::size_t bytes;  ///< of a value; of bits, eight share one
};

/// The keywords of a legacy .vtk file, which stand on lines of their own in either encoding, and its arrays.
class VtkCursor : public ValueCursor {
 public:
  /// Words of a line.
  using Words = std::array<std::string_view, 4>;

  /// `bytes` must outlive the cursor.
  VtkCursor(std::string file, std::string_view bytes) : ValueCursor(std::move(file), bytes, Layout::kAnywhere) {}

  /// The words of the next line that is neither blank nor of METADATA, up to four of them; none at the end of the file.
  Words read_keywords();

  /// A number of the keywords' line, at least 0.
  std::uint64_t number(std::string_view word, std::string_view what) const;

  /// A type by its name in the file.
  VtkType type(std::string_view name) const;

  /// Refuses a number of values that the rest of the file cannot hold.
  void check_values(std::uint64_t count, const VtkType& type, std::string_view what) const;

  double read_real_of(const VtkType& type, std::string_view what);
  std::int64_t read_integer_of(const VtkType& type, std::string_view what);
  void skip_values(std::uint64_t count, const VtkType& type, std::string_view what);

 private:
  void refuse_cut() const;
};

}  // namespace exmat::precompute
