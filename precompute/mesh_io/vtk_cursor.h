#pragma once

#include <array>
#include <string_view>

#include "common/surface_io/value_cursor.h"

namespace exmat::precompute {

/// The keywords of a legacy .vtk file, which stand on lines of their own in either encoding.
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
  NumberType type(std::string_view name) const;
};

}  // namespace exmat::precompute
