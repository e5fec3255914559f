#include "precompute/inputs/correspondence_files.h"

#include <fmt/format.h>
#include <string>
#include <string_view>

#include "common/core/error.h"
#include "common/core/input_file.h"
#include "common/surface_io/text_input.h"

namespace exmat::precompute {
namespace {

// A line that holds more than a comment, and its number in the file.
struct Line {
  std::string_view text;
  Eigen::Index number = 0;
};

std::vector<Line> lines_of(std::string_view text) {
  std::vector<Line> lines;
  for (Eigen::Index number = 1; !text.empty(); ++number) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    const std::string_view line = trimmed(text.substr(0, std::min(text.find('#'), end)));
    if (!line.empty()) lines.push_back({line, number});
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return lines;
}

class LineReader {
 public:
  explicit LineReader(const std::filesystem::path& file) : file_(file.string()) {}

  // The numbers of a line, one for each of `sizes`.
  std::vector<std::int32_t> read(const Line& line, const std::vector<Eigen::Index>& sizes) const {
    Fields fields(line.text);
    std::vector<std::int32_t> numbers;
    for (const Eigen::Index size : sizes) numbers.push_back(vertex(line, fields.next(), size, sizes.size()));
    if (const auto extra = fields.next(); !extra.empty())
      refuse(line, count_of(sizes.size()), quote(extra) + " after them");
    return numbers;
  }

 private:
  static std::string count_of(std::size_t count) {
    return count == 1 ? "one vertex number or '-'" : fmt::format("{} vertex numbers or '-'", count);
  }

  std::int32_t vertex(const Line& line, std::string_view field, Eigen::Index size, std::size_t count) const {
    if (field == "-") return -1;
    if (field.empty()) refuse(line, count_of(count), "fewer");
    const auto number = parse_integer(field);
    if (!number || *number < 1 || *number > size)
      refuse(line, fmt::format("a vertex number from 1 to {} or '-'", size), quote(field));
    return static_cast<std::int32_t>(*number - 1);
  }

  [[noreturn]] void refuse(const Line& line, const std::string& expected, const std::string& found) const {
    throw InputError({file_, fmt::format("line {}", line.number), expected, found, ""});
  }

  std::string file_;
};

}  // namespace

IndexMatrix read_landmarks(const std::filesystem::path& file, const std::vector<Eigen::Index>& sizes) {
  const std::string text = read_text_file(file, "a text file of landmarks");
  const auto lines = lines_of(text);
  if (lines.empty()) throw InputError({file.string(), "", "lines of vertex numbers", "none", ""});
  const LineReader reader(file);
  IndexMatrix landmarks(std::ssize(lines), std::ssize(sizes));
  for (Eigen::Index k = 0; k < landmarks.rows(); ++k) {
    const auto numbers = reader.read(lines[static_cast<std::size_t>(k)], sizes);
    for (Eigen::Index column = 0; column < landmarks.cols(); ++column)
      landmarks(k, column) = numbers[static_cast<std::size_t>(column)];
  }
  return landmarks;
}

IndexVector read_vertex_map(const std::filesystem::path& file, Eigen::Index object_size, Eigen::Index example_size) {
  const std::string text = read_text_file(file, "a text file of vertex numbers");
  const auto lines = lines_of(text);
  if (std::ssize(lines) != object_size)
    throw InputError({file.string(), "", fmt::format("{} lines, one for each vertex of the object", object_size),
                      std::to_string(lines.size()), ""});
  const LineReader reader(file);
  IndexVector map(object_size);
  for (Eigen::Index v = 0; v < object_size; ++v)
    map[v] = reader.read(lines[static_cast<std::size_t>(v)], {example_size}).front();
  return map;
}

}  // namespace exmat::precompute
