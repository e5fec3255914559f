#include "common/config/vertex_ids.h"

#include <algorithm>
#include <charconv>
#include <fmt/format.h>
#include <string>
#include <string_view>
#include <unordered_set>

#include "common/core/error.h"
#include "common/core/input_file.h"

namespace exmat {
namespace {

constexpr std::string_view kSeparators = ", \t\r";

std::int64_t parse_id(std::string_view word, std::int64_t largest, std::string_view noun, const std::string& file,
                      const std::string& place) {
  std::int64_t id = 0;
  const auto result = std::from_chars(word.data(), word.data() + word.size(), id);
  const bool is_integer = result.ec == std::errc() && result.ptr == word.data() + word.size();
  if (!is_integer || id < 1 || id > largest) {
    const std::string range = largest == kLargestVertexId ? ">= 1" : fmt::format("from 1 to {}", largest);
    throw InputError({file, place, fmt::format("{} ids {}", noun, range), fmt::format("\"{}\"", word), ""});
  }
  return id - 1;
}

}  // namespace

std::vector<std::int64_t> read_vertex_ids(const std::filesystem::path& file, std::int64_t largest,
                                          std::string_view noun) {
  const std::string text = read_text_file(file, fmt::format("a text file of {} ids", noun));
  std::vector<std::int64_t> ids;
  std::unordered_set<std::int64_t> seen;
  std::size_t line_number = 0;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    std::string_view line(text.data() + begin, end - begin);
    line = line.substr(0, line.find('#'));
    const std::string place = fmt::format("line {}", ++line_number);
    for (std::size_t at = line.find_first_not_of(kSeparators); at < line.size();
         at = line.find_first_not_of(kSeparators, at)) {
      const std::size_t stop = std::min(line.find_first_of(kSeparators, at), line.size());
      ids.push_back(parse_id(line.substr(at, stop - at), largest, noun, file.string(), place));
      if (!seen.insert(ids.back()).second)
        throw InputError(
            {file.string(), place, fmt::format("each {} once", noun), fmt::format("{} again", ids.back() + 1), ""});
      at = stop;
    }
    begin = end + 1;
  }
  if (ids.empty()) throw InputError({file.string(), "", fmt::format("{} ids >= 1", noun), "none", ""});
  return ids;
}

}  // namespace exmat
