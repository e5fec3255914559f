#include "common/surface_io/mesh_arrays.h"

namespace exmat {
namespace {

template <typename Array, typename Row>
Array to_array(const std::vector<Row>& rows) {
  Array array(std::ssize(rows), static_cast<Eigen::Index>(std::tuple_size_v<Row>));
  for (std::size_t k = 0; k < rows.size(); ++k)
    for (std::size_t column = 0; column < std::tuple_size_v<Row>; ++column)
      array(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(column)) = rows[k][column];
  return array;
}

}  // namespace

VertexArray vertex_array(const std::vector<std::array<double, 3>>& rows) { return to_array<VertexArray>(rows); }

TetArray tet_array(const std::vector<std::array<std::int32_t, 4>>& rows) { return to_array<TetArray>(rows); }

TriangleArray triangle_array(const std::vector<std::array<std::int32_t, 3>>& rows) {
  return to_array<TriangleArray>(rows);
}

std::map<std::string, std::vector<std::int32_t>> region_sets(const std::vector<std::int64_t>& regions) {
  std::map<std::string, std::vector<std::int32_t>> sets;
  for (std::size_t t = 0; t < regions.size(); ++t)
    if (regions[t] != 0) sets[std::to_string(regions[t])].push_back(static_cast<std::int32_t>(t));
  return sets;
}

}  // namespace exmat
