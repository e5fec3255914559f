#include "common/surface_io/surface_parts.h"

#include <fmt/format.h>

namespace exmat {
namespace {

// Flags for each byte of the file, and for small files in any case.
constexpr std::size_t kFlagsPerByte = 64, kFlags = 64'000'000;

}  // namespace

void SurfaceParts::add_triangles(const std::string& name, std::size_t begin, std::size_t end) {
  if (name.empty() || begin >= end) return;
  auto& ranges = parts_[name].triangles;
  while (!ranges.empty() && ranges.back().first >= begin) ranges.pop_back();
  ranges.emplace_back(begin, end);
}

void SurfaceParts::add_vertex(const std::string& name, std::int32_t vertex) { parts_[name].vertices.push_back(vertex); }

void SurfaceParts::finish(SurfaceFile& surface, std::size_t file_bytes) const {
  const auto rows = static_cast<std::size_t>(surface.mesh.vertices.rows() + surface.mesh.triangles.rows());
  if (parts_.size() * rows > kFlags + kFlagsPerByte * file_bytes) {
    surface.remarks.push_back(
        fmt::format("its {} names of parts are too many for its size: none is kept", parts_.size()));
    return;
  }
  for (const auto& [name, part] : parts_) {
    FlagVector flags = FlagVector::Zero(surface.mesh.vertices.rows());
    for (const auto& [begin, end] : part.triangles)
      for (auto t = static_cast<Eigen::Index>(begin); t < static_cast<Eigen::Index>(end); ++t)
        for (const auto corner : surface.mesh.triangles.row(t)) flags[corner] = 1;
    for (const auto vertex : part.vertices) flags[vertex] = 1;
    surface.parts.emplace(name, std::move(flags));
  }
}

}  // namespace exmat
