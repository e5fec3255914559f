#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace exmat::precompute {

/// Reads the values of a .msh file, held in memory, in either encoding: text until set_binary, which section names and
/// counts of version 2.2 stay in. Every fault is an InputError whose place is a line of a text file or a byte of a
/// binary one.
class MshCursor {
 public:
  /// `bytes` must outlive the cursor.
  MshCursor(std::string file, std::string_view bytes);

  /// From here on the values of sections are binary; `swap` where their byte order is foreign.
  void set_binary(bool swap);
  bool is_binary() const { return binary_; }

  /// The name after '$' of the section that begins here; empty at the end of the file.
  std::string_view begin_section();
  /// Reads "$End" and the name.
  void end_section(std::string_view name);
  /// Moves to the "$End" of a section that is not read.
  void skip_section(std::string_view name);

  /// Begins a record: in text, its values stand on one line.
  void begin_record();
  /// The next value; `what` is for the message, e.g. "a node tag".
  std::int32_t read_int(std::string_view what);
  std::uint64_t read_size(std::string_view what);
  double read_real(std::string_view what);
  /// Passes over values that are not used.
  void skip_ints(std::uint64_t count, std::string_view what);
  void skip_sizes(std::uint64_t count, std::string_view what);

  /// A number of records of which each takes at least so many bytes: refused where the rest of the file cannot hold
  /// them.
  std::uint64_t read_count(std::string_view what, std::size_t min_text_bytes, std::size_t min_binary_bytes);
  /// As read_count, but a line of text in either encoding.
  std::uint64_t read_text_count(std::string_view what, std::size_t min_text_bytes, std::size_t min_binary_bytes);
  /// A whole line of text, without the blanks around it.
  std::string_view read_text_line(std::string_view what);

  /// Offset of the value or name read last, for fail.
  std::size_t last_offset() const { return last_; }
  [[noreturn]] void fail(const std::string& expected, const std::string& found, const std::string& advice = "") const;
  [[noreturn]] void fail_at(std::size_t offset, const std::string& expected, const std::string& found,
                            const std::string& advice = "") const;

 private:
  std::string_view rest() const { return bytes_.substr(offset_); }
  std::string_view read_word();
  void finish_line();
  std::string describe(std::string_view word) const;
  template <typename Number>
  Number read_raw(std::string_view what);
  void check_count(std::uint64_t count, std::string_view what, std::size_t min_bytes) const;

  std::string file_;
  std::string_view bytes_;
  std::size_t offset_ = 0;
  std::size_t last_ = 0;
  bool binary_ = false;
  bool swap_ = false;
};

}  // namespace exmat::precompute
