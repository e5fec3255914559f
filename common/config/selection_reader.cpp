#include "common/config/selection_reader.h"

#include <fmt/format.h>

#include "common/config/json_file.h"
#include "common/config/vertex_ids.h"
#include "common/core/error.h"

namespace exmat {
namespace {

BoxSelection read_box_selection(const Json& json, const std::filesystem::path& file, const std::string& place) {
  const BoxSelection box{json["min"].get<std::array<double, 3>>(), json["max"].get<std::array<double, 3>>()};
  for (std::size_t axis = 0; axis < 3; ++axis)
    if (box.min[axis] > box.max[axis])
      throw InputError({file.string(), fmt::format("{}/max/{}", place, axis),
                        fmt::format("a number >= {} (min)", box.min[axis]), fmt::format("{}", box.max[axis]), ""});
  return box;
}

}  // namespace

VertexSelection read_selection(const Json& json, const std::filesystem::path& file, const std::string& place) {
  if (json.contains("box")) return read_box_selection(json["box"], file, place + "/box");
  if (json.contains("sphere"))
    return SphereSelection{json["sphere"]["center"].get<std::array<double, 3>>(), json["sphere"]["radius"]};
  if (json.contains("file")) return FileSelection{resolve_path(file, json["file"])};
  if (json.contains("part")) return PartSelection{json["part"]};
  if (json.contains("color"))
    return ColourSelection{json["color"]["rgb"].get<std::array<double, 3>>(), json["color"].value("within", 0.1)};
  if (json.contains("point")) return PointSelection{json["point"].get<std::array<double, 3>>()};
  return IdSelection{read_ids(json["ids"], file, place + "/ids")};
}

}  // namespace exmat
