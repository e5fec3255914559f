#include "common/config/json_values.h"

#include <fmt/format.h>
#include <unordered_set>

#include "common/core/error.h"

namespace exmat {

std::filesystem::path resolve_path(const std::filesystem::path& json_file, const std::string& path) {
  return (json_file.parent_path() / path).lexically_normal();
}

void require_file(const std::filesystem::path& file, const std::filesystem::path& json_file, const std::string& place,
                  const std::string& expected, const std::string& advice) {
  std::error_code ignored;
  if (!std::filesystem::exists(file, ignored))
    throw InputError({json_file.string(), place, expected, "no such file: " + file.string(), advice});
}

std::vector<std::int64_t> read_ids(const Json& ids, const std::filesystem::path& json_file, const std::string& place) {
  auto values = ids.get<std::vector<std::int64_t>>();
  std::unordered_set<std::int64_t> seen;
  for (std::size_t i = 0; i < values.size(); ++i)
    if (!seen.insert(values[i]).second)
      throw InputError({json_file.string(), fmt::format("{}/{}", place, i), "each vertex once",
                        fmt::format("{} again", values[i]), ""});
  return values;
}

}  // namespace exmat
