#include "precompute/targets/tet_parts.h"

#include <algorithm>
#include <span>

namespace exmat::precompute {
namespace {

using Tets = std::span<Eigen::Index>;

class Halving {
 public:
  Halving(const TetMesh& mesh, Eigen::Index most, std::vector<TetPart>& parts)
      : mesh_(mesh), most_(most), parts_(parts), centres_(mesh.tet_count(), 3) {
    for (Eigen::Index t = 0; t < centres_.rows(); ++t)
      centres_.row(t) = mesh.vertices(mesh.tets.row(t), Eigen::all).colwise().sum();
  }

  void halve(Tets tets) {
    if (std::ssize(tets) <= most_) return finish(tets);
    Eigen::RowVector3d low = centres_.row(tets.front()), high = low;
    for (const Eigen::Index t : tets) {
      low = low.cwiseMin(centres_.row(t));
      high = high.cwiseMax(centres_.row(t));
    }
    Eigen::Index axis = 0;
    (high - low).maxCoeff(&axis);
    const std::size_t half = tets.size() / 2;
    std::ranges::nth_element(tets, tets.begin() + static_cast<std::ptrdiff_t>(half), [&](auto a, auto b) {
      return centres_(a, axis) != centres_(b, axis) ? centres_(a, axis) < centres_(b, axis) : a < b;
    });
    halve(tets.first(half));
    halve(tets.subspan(half));
  }

 private:
  void finish(Tets tets) {
    std::ranges::sort(tets);
    TetPart& part = parts_.emplace_back();
    part.tets.assign(tets.begin(), tets.end());
    for (const Eigen::Index t : tets)
      for (const std::int32_t vertex : mesh_.tets.row(t)) part.vertices.push_back(vertex);
    std::ranges::sort(part.vertices);
    part.vertices.erase(std::unique(part.vertices.begin(), part.vertices.end()), part.vertices.end());
    part.corners.resize(4, std::ssize(tets));
    for (std::size_t i = 0; i < tets.size(); ++i)
      for (int c = 0; c < 4; ++c) {
        const auto place = std::ranges::lower_bound(part.vertices, mesh_.tets(tets[i], c));
        part.corners(c, static_cast<Eigen::Index>(i)) = static_cast<std::int16_t>(place - part.vertices.begin());
      }
  }

  const TetMesh& mesh_;
  Eigen::Index most_;
  std::vector<TetPart>& parts_;
  VertexArray centres_;  // times 4
};

}  // namespace

std::vector<TetPart> tet_parts(const TetMesh& mesh, std::vector<Eigen::Index> tets, Eigen::Index most) {
  std::vector<TetPart> parts;
  if (!tets.empty()) Halving(mesh, most, parts).halve(tets);
  return parts;
}

}  // namespace exmat::precompute
