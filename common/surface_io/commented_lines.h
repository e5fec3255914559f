#pragma once

#include <deque>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/surface_io/text_input.h"

namespace exmat {

/// A line without its comment and the blanks around it. Views stay valid as long as the CommentedLines.
struct FileLine {
  std::string_view text;
  const std::filesystem::path* file = nullptr;
  std::size_t number = 0;  ///< 1-based
};

/// Throws the InputError of one line.
[[noreturn]] void fail_at(const FileLine& line, const std::string& expected, const std::string& found,
                          const std::string& advice = "");

/// The next field of a line as a finite number; `what` is for the message, e.g. "a density".
double read_real(const FileLine& line, Fields& fields, std::string_view what);

/// The lines of a text file that hold more than a comment, which '#' begins. With an `include` keyword, the lines of
/// the files that such lines name stand in their place; paths are relative to the file that names them.
class CommentedLines {
 public:
  /// `kind` is for messages: "a .veg file".
  CommentedLines(const std::filesystem::path& file, std::string kind, std::string_view include = {});

  /// The line to read next; empty at the end of the file.
  const std::optional<FileLine>& current() const { return current_; }
  void advance();

  /// As fail_at(current line), or at the end of the named file.
  [[noreturn]] void fail(const std::string& expected, const std::string& advice = "") const;

  /// Every file opened so far, the named one first.
  std::vector<std::filesystem::path> files() const;

 private:
  struct File {
    std::filesystem::path path;
    std::string text;
    std::size_t offset = 0;
    std::size_t line = 0;
  };
  std::optional<FileLine> next_plain_line();
  void open(const std::filesystem::path& file);
  void open_include(const FileLine& line);

  std::string kind_;
  std::string_view include_;
  std::deque<File> files_;
  std::vector<File*> open_;  // the innermost last
  std::optional<FileLine> current_;
};

}  // namespace exmat
