#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace exmat {

/// A type of number of a file that names them.
struct NumberType {
  enum class Kind { kSigned, kUnsigned, kReal, kBits };
  Kind kind;
  std::size_t bytes;  ///< size of a binary value; eight bits share one byte
};

/// Reads the values of a mesh file, held in memory, in either encoding: text until set_binary, which words and lines
/// stay in. Every fault is an InputError whose place is a line of a text file or a byte of a binary one.
class ValueCursor {
 public:
  /// Place of the next value of a text: on the same line, or on any after it.
  enum class Layout { kLine, kAnywhere };

  /// `bytes` must outlive the cursor. `comment` begins one that ends with its line; none where it is zero.
  ValueCursor(std::string file, std::string_view bytes, Layout layout, char comment = '\0');

  /// From here on values are binary; `swap` where their byte order is foreign.
  void set_binary(bool swap);
  bool is_binary() const { return binary_; }

  /// The next word of text, in either encoding; empty at the end of the file or, in lines, of the line.
  std::string_view read_word();
  /// The next value; `what` is for the message, e.g. "a node tag".
  std::int32_t read_int(std::string_view what);
  std::uint64_t read_size(std::string_view what);
  double read_real(std::string_view what);
  /// A value of a type that the file names.
  double read_real_of(const NumberType& type, std::string_view what);
  std::int64_t read_integer_of(const NumberType& type, std::string_view what);
  void skip_values(std::uint64_t count, const NumberType& type, std::string_view what);
  /// Refuses a number of values that the rest of the file cannot hold.
  void check_values(std::uint64_t count, const NumberType& type, std::string_view what) const;
  /// A binary value of another type.
  template <typename Number>
  Number read_binary(std::string_view what);
  /// Passes over bytes that are not used.
  std::string_view read_bytes(std::uint64_t count, std::string_view what);

  /// A number of records of which each takes at least so many bytes: refused where the rest of the file cannot hold
  /// them.
  std::uint64_t read_count(std::string_view what, std::size_t min_text_bytes, std::size_t min_binary_bytes);
  /// As read_count, but a line of text in either encoding.
  std::uint64_t read_text_count(std::string_view what, std::size_t min_text_bytes, std::size_t min_binary_bytes);
  /// Refuses at the last value a count whose records the rest of the file cannot hold.
  void check_count(std::uint64_t count, std::string_view what, std::size_t min_bytes) const;
  /// A whole line of text, without the blanks around it.
  std::string_view read_text_line(std::string_view what);

  /// True if nothing but blanks is left.
  bool at_end() const;
  /// To the next line that is not blank.
  void skip_blank_lines();
  /// Offset of the value or name read last, for fail.
  std::size_t last_offset() const { return last_; }
  [[noreturn]] void fail(const std::string& expected, const std::string& found, const std::string& advice = "") const;
  [[noreturn]] void fail_at(std::size_t offset, const std::string& expected, const std::string& found,
                            const std::string& advice = "") const;
  /// A word for the message of a fault at it.
  std::string describe(std::string_view word) const;

 protected:
  std::string_view rest() const { return bytes_.substr(offset_); }
  void finish_line();
  /// Moves to an offset before the end.
  void move_to(std::size_t offset) { offset_ = offset; }
  std::size_t find(std::string_view text) const { return bytes_.find(text, offset_); }

 private:
  void skip_blanks();

  std::string file_;
  std::string_view bytes_;
  Layout layout_;
  char comment_;
  std::size_t offset_ = 0;
  std::size_t last_ = 0;
  bool binary_ = false;
  bool swap_ = false;
};

}  // namespace exmat
