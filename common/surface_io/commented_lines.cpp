#include "common/surface_io/commented_lines.h"

#include <algorithm>
#include <fmt/format.h>

#include "common/core/error.h"
#include "common/core/input_file.h"

namespace exmat {
namespace {

// Files that include each other in a fan would otherwise grow without bound.
constexpr std::size_t kMaxFiles = 100;

std::size_t next_line_end(std::string_view text, std::size_t offset) {
  return std::min(text.find('\n', offset), text.size());
}

std::string_view without_comment(std::string_view line) { return trimmed(line.substr(0, line.find('#'))); }

}  // namespace

void fail_at(const FileLine& line, const std::string& expected, const std::string& found, const std::string& advice) {
  throw InputError({line.file->string(), "line " + std::to_string(line.number), expected, found, advice});
}

double read_real(const FileLine& line, Fields& fields, std::string_view what) {
  const std::string_view field = fields.next();
  const auto value = parse_real(field);
  if (!value) fail_at(line, fmt::format("{}, a finite number", what), quote(field), advice_for_number(field));
  return *value;
}

CommentedLines::CommentedLines(const std::filesystem::path& file, std::string kind, std::string_view include)
    : kind_(std::move(kind)), include_(include) {
  open(file);
  advance();
}

void CommentedLines::advance() {
  current_ = next_plain_line();
  while (current_ && !include_.empty() && Fields(current_->text).next() == include_) {
    open_include(*current_);
    current_ = next_plain_line();
  }
}

void CommentedLines::fail(const std::string& expected, const std::string& advice) const {
  if (current_) fail_at(*current_, expected, quote(current_->text), advice);
  const File& main = files_.front();
  fail_at({"", &main.path, std::max<std::size_t>(main.line, 1)}, expected, "the end of the file", advice);
}

std::vector<std::filesystem::path> CommentedLines::files() const {
  std::vector<std::filesystem::path> paths;
  for (const File& file : files_)
    if (std::find(paths.begin(), paths.end(), file.path) == paths.end()) paths.push_back(file.path);
  return paths;
}

std::optional<FileLine> CommentedLines::next_plain_line() {
  while (!open_.empty()) {
    File& file = *open_.back();
    if (file.offset >= file.text.size()) {
      open_.pop_back();
      continue;
    }
    const std::size_t end = next_line_end(file.text, file.offset);
    const std::string_view text = without_comment(std::string_view(file.text).substr(file.offset, end - file.offset));
    file.offset = end + 1;
    ++file.line;
    if (!text.empty()) return FileLine{text, &file.path, file.line};
  }
  return std::nullopt;
}

void CommentedLines::open(const std::filesystem::path& file) {
  files_.push_back({file, read_text_file(file, kind_)});
  open_.push_back(&files_.back());
}

void CommentedLines::open_include(const FileLine& line) {
  const std::string_view name = trimmed(line.text.substr(include_.size()));
  if (name.empty()) fail_at(line, std::string(include_) + " and the name of a file", quote(line.text));
  const std::filesystem::path path = line.file->parent_path() / name;
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error))
    fail_at(line, std::string(include_) + " of a file beside this one", "no such file: " + path.string());
  const bool is_open = std::any_of(open_.begin(), open_.end(), [&](const File* file) {
    return std::filesystem::equivalent(file->path, path, error);
  });
  if (is_open) fail_at(line, std::string(include_) + " of another file", quote(line.text) + ", which includes itself");
  if (files_.size() >= kMaxFiles)
    fail_at(line, "at most " + std::to_string(kMaxFiles - 1) + " files included", "one more");
  open(path);
}

}  // namespace exmat
