#include "common/config/json_values.h"

#include <fmt/format.h>
#include <unordered_set>

#include "common/core/error.h"

namespace exmat {

std::filesystem::path resolve_path(const std::filesystem::path& json_file, const std::string& path) {
  return (json_file.parent_path() / path).lexically_normal();
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
