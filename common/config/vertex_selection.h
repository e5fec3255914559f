#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "common/core/arrays.h"
#include "common/model/vertex_marks.h"

namespace exmat {

/// Vertices inside an axis-aligned box, bounds included [m].
struct BoxSelection {
  std::array<double, 3> min{}, max{};
};
/// Vertices inside a ball, its surface included [m].
struct SphereSelection {
  std::array<double, 3> centre{};
  double radius = 0;
};
/// Vertex ids in a text file, 1-based as in .bou files: separated by commas, blanks or lines; '#' starts a comment.
struct FileSelection {
  std::filesystem::path file;
};
/// 0-based vertex ids.
struct IdSelection {
  std::vector<std::int64_t> ids;
};
/// Vertices nearest to a part of the object's surface, by its name in the file.
struct PartSelection {
  std::string name;
};
/// Vertices nearest to a part of the object's surface that has a colour.
struct ColourSelection {
  std::array<double, 3> colour{};  ///< red, green, blue, 0 to 1
  double within = 0.1;             ///< largest difference of each
};
/// The vertex nearest to a point, of several the first [m].
struct PointSelection {
  std::array<double, 3> point{};
};
using VertexSelection = std::variant<BoxSelection, SphereSelection, FileSelection, IdSelection, PartSelection,
                                     ColourSelection, PointSelection>;

/// True if the selection asks for the marks of a surface.
bool needs_marks(const VertexSelection& selection);

/// Points to choose from, and what messages call them.
struct SelectablePoints {
  const VertexArray& points;           ///< at rest [m]
  const VertexMarks* marks = nullptr;  ///< marks of each point; none where the object was not made about a surface
  std::string_view noun = "vertex";    ///< one of them
  std::string file{}, place{};         ///< source of the selection
  std::string surface{};               ///< that the marks are of
};

/// Sorted unique 0-based numbers of the points that are selected. Throws InputError where an id is none, a file cannot
/// be read, a part is not known (the nearest name is suggested), a point is farther off than the body is large, or
/// nothing is selected (the message then has the bounding box).
std::vector<std::int32_t> select_points(const SelectablePoints& from, const VertexSelection& selection);

}  // namespace exmat
