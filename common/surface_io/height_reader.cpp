#include "common/surface_io/height_reader.h"

#include <fmt/format.h>
#include <vector>

#include "common/surface_io/commented_lines.h"

namespace exmat {

RowMatrix read_heights(const std::filesystem::path& file) {
  CommentedLines lines(file, "a text file of heights");
  std::vector<double> heights;
  std::size_t columns = 0, rows = 0;
  for (; lines.current(); lines.advance(), ++rows) {
    const FileLine& line = *lines.current();
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
