#include "common/model/vertex_marks.h"

#include <algorithm>
#include <utility>
#include <vector>

namespace exmat {

void pack_marks(const VertexMarks& marks, ObjectData& object) {
  object.colours = marks.colours;
  if (marks.parts.empty()) return;
  std::string names;
  for (const auto& [name, flags] : marks.parts) names += name + '\0';
  object.part_names = Eigen::Map<const FlagVector>(reinterpret_cast<const std::uint8_t*>(names.data()),
                                                   static_cast<Eigen::Index>(names.size()));
  const Eigen::Index vertices = marks.parts.begin()->second.size();
  std::map<std::vector<std::uint8_t>, std::int32_t> sets;
  object.vertex_parts.resize(vertices);
  for (Eigen::Index vertex = 0; vertex < vertices; ++vertex) {
    std::vector<std::uint8_t> set;
    for (const auto& [name, flags] : marks.parts) set.push_back(flags[vertex]);
    object.vertex_parts[vertex] =
        sets.try_emplace(std::move(set), static_cast<std::int32_t>(sets.size())).first->second;
  }
  object.part_sets.resize(static_cast<Eigen::Index>(sets.size()), static_cast<Eigen::Index>(marks.parts.size()));
  for (const auto& [set, row] : sets)
    object.part_sets.row(row) =
        Eigen::Map<const FlagVector>(set.data(), static_cast<Eigen::Index>(set.size())).transpose();
}

VertexMarks marks_of(const ObjectData& object) {
  VertexMarks marks;
  marks.colours = object.colours;
  const auto* const end = object.part_names.data() + object.part_names.size();
  Eigen::Index column = 0;
  for (const auto* first = object.part_names.data(); first != end && column < object.part_sets.cols(); ++column) {
    const auto* const last = std::find(first, end, 0);
    FlagVector& flags = marks.parts[std::string(first, last)];
    flags.resize(object.vertex_parts.size());
    for (Eigen::Index vertex = 0; vertex < flags.size(); ++vertex)
      flags[vertex] = object.part_sets(object.vertex_parts[vertex], column);
    first = last == end ? end : last + 1;
  }
  return marks;
}

}  // namespace exmat
