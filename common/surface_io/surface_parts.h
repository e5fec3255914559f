#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "common/surface_io/surface.h"

namespace exmat {

/// Gathers the parts that a surface's file names, while it is read.
class SurfaceParts {
 public:
  /// The corners of the triangles from `begin` to before `end` are of the part. Empty names and ranges are none. `end`
  /// is that of all triangles so far: earlier ranges from `begin` on are within it.
  void add_triangles(const std::string& name, std::size_t begin, std::size_t end);
  void add_vertex(const std::string& name, std::int32_t vertex);

  /// Sets the parts of a surface whose mesh is there. Where names and vertices are more than memory in proportion to
  /// the file's bytes can hold, no part is kept and a remark says so.
  void finish(SurfaceFile& surface, std::size_t file_bytes) const;

 private:
  struct Part {
    std::vector<std::pair<std::size_t, std::size_t>> triangles;
    std::vector<std::int32_t> vertices;
  };
  std::map<std::string, Part> parts_;
};

}  // namespace exmat
