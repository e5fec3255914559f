#pragma once

#include "common/surface_io/value_cursor.h"

namespace exmat::precompute {

/// The sections of a .msh file, whose names and, in version 2.2, counts are text in either encoding.
class MshCursor : public ValueCursor {
 public:
  /// `bytes` must outlive the cursor.
  MshCursor(std::string file, std::string_view bytes) : ValueCursor(std::move(file), bytes, Layout::kLine) {}

  /// The name after '$' of the section that begins here; empty at the end of the file.
  std::string_view begin_section();
  /// Reads "$End" and the name.
  void end_section(std::string_view name);
  /// Moves to the "$End" of a section that is not read.
  void skip_section(std::string_view name);

  /// Begins a record: in text, its values stand on one line.
  void begin_record();
  /// Passes over values that are not used.
  void skip_ints(std::uint64_t count, std::string_view what);
  void skip_sizes(std::uint64_t count, std::string_view what);
};

}  // namespace exmat::precompute
