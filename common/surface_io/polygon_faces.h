#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

namespace exmat {

/// The faces of a surface's file as triangles: a face of n corners is n - 2 of them, one after the other.
class PolygonFaces {
 public:
  /// A face of at least three corners, whose vertices need not be known yet.
  void add(const std::vector<std::int32_t>& polygon);

  const std::vector<std::array<std::int32_t, 3>>& triangles() const { return triangles_; }

  /// Faces whose first corner sees all others, as convex ones, stay fans about it. Ears are cut off the others
  /// (Meisters 1975), in the plane of their Newell normal. All corners must be rows of `vertices`. Throws InputError
  /// if that takes too long, as of thousands of edges that cross. Returns a warning of faces that cross themselves.
  std::vector<std::string> cut_ears(const std::vector<std::array<double, 3>>& vertices,
                                    const std::filesystem::path& file);

 private:
  std::vector<std::array<std::int32_t, 3>> triangles_;
  std::vector<std::pair<std::size_t, std::size_t>> polygons_;  // first triangle and number of corners, from four on
};

}  // namespace exmat
