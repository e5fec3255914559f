#include "common/surface_io/height_reader.h"

#include <algorithm>
#include <fmt/format.h>
#include <string_view>
#include <vector>

#include "common/surface_io/commented_lines.h"

namespace exmat {

namespace {

/// True where numbers stand between both, as in "0,5 1,5", the two numbers of one who writes decimal commas.
bool has_blanks_and_commas(std::string_view line) {
  bool blanks = false;
  std::size_t commas = 0;
  for (std::size_t begin = 0; begin <= line.size(); ++commas) {
    const std::size_t end = std::min(line.find(',', begin), line.size());
    blanks = blanks || trimmed(line.substr(begin, end - begin)).find_first_of(" \t") != std::string_view::npos;
    begin = end + 1;
  }
  return blanks && commas > 1;
}

}  // namespace

RowMatrix read_heights(const std::filesystem::path& file) {
  CommentedLines lines(file, "a text file of heights");
  std::vector<double> heights;
  std::size_t columns = 0, rows = 0;
  for (; lines.current(); lines.advance(), ++rows) {
    const FileLine& line = *lines.current();
    if (has_blanks_and_commas(line.text))
      fail_at(line, "numbers between commas, or between blanks", quote(line.text), "write numbers with decimal points");
    std::size_t count = 0;
    for (Fields fields(line.text), rest = fields; !rest.next().empty(); ++count, rest = fields)
      heights.push_back(read_real(line, fields, fmt::format("height {} of the row", count + 1)));
    if (rows == 0) columns = count;
    if (count != columns) fail_at(line, fmt::format("{} heights, as in the first row", columns), std::to_string(count));
    if (columns < 2) fail_at(line, "2 or more heights in a row", std::to_string(columns));
  }
  if (rows < 2) lines.fail("2 or more rows of heights");
  return Eigen::Map<const RowMatrix>(heights.data(), static_cast<Eigen::Index>(rows),
                                     static_cast<Eigen::Index>(columns));
}

}  // namespace exmat
