#include "precompute/alignment/landmark_check.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <queue>
#include <utility>

namespace exmat::precompute {
namespace {

constexpr std::size_t kFewest = 6;     // landmarks that can contradict one of them
constexpr double kContradicts = 0.15;  // median difference of ways, over the body's longest
constexpr double kStandsOut = 2.5;     // times the median of all

// The lower one of an even number: half of the others must differ, whichever end of the body has one more.
double median(std::vector<double> values) {
  const auto middle = values.begin() + (std::ssize(values) - 1) / 2;
  std::ranges::nth_element(values, middle);
  return *middle;
}

std::vector<std::vector<std::int32_t>> neighbours_of(const TetMesh& mesh) {
  std::vector<std::vector<std::int32_t>> neighbours(static_cast<std::size_t>(mesh.vertex_count()));
  for (const auto tet : mesh.tets.rowwise())
    for (const auto a : tet)
      for (const auto b : tet)
        if (a != b) neighbours[static_cast<std::size_t>(a)].push_back(b);
  for (auto& list : neighbours) {
    std::ranges::sort(list);
    list.erase(std::unique(list.begin(), list.end()), list.end());
  }
  return neighbours;
}

// Dijkstra 1959.
std::vector<double> distances_from(const TetMesh& mesh, const std::vector<std::vector<std::int32_t>>& neighbours,
                                   std::int32_t source) {
  std::vector<double> distances(neighbours.size(), std::numeric_limits<double>::infinity());
  std::priority_queue<std::pair<double, std::int32_t>, std::vector<std::pair<double, std::int32_t>>, std::greater<>>
      open;
  distances[static_cast<std::size_t>(source)] = 0;
  open.emplace(0, source);
  while (!open.empty()) {
    const auto [distance, at] = open.top();
    open.pop();
    if (distance > distances[static_cast<std::size_t>(at)]) continue;
    for (const auto next : neighbours[static_cast<std::size_t>(at)]) {
      const double way = distance + (mesh.vertices.row(at) - mesh.vertices.row(next)).norm();
      if (way >= distances[static_cast<std::size_t>(next)]) continue;
      distances[static_cast<std::size_t>(next)] = way;
      open.emplace(way, next);
    }
  }
  return distances;
}

}  // namespace

Eigen::MatrixXd edge_distances(const TetMesh& mesh, const std::vector<std::int32_t>& vertices) {
  const auto neighbours = neighbours_of(mesh);
  Eigen::MatrixXd result(std::ssize(vertices), std::ssize(vertices));
  for (std::size_t k = 0; k < vertices.size(); ++k) {
    const auto distances = distances_from(mesh, neighbours, vertices[k]);
    for (std::size_t other = 0; other < vertices.size(); ++other)
      result(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(other)) =
          distances[static_cast<std::size_t>(vertices[other])];
  }
  return result;
}

std::vector<std::size_t> contradicting_landmarks(const TetMesh& rest, const std::vector<std::int32_t>& on_rest,
                                                 const TetMesh& pose, const std::vector<std::int32_t>& on_pose) {
  if (on_rest.size() < kFewest) return {};
  const Eigen::MatrixXd at_rest = edge_distances(rest, on_rest);
  const Eigen::MatrixXd differences = (edge_distances(pose, on_pose) - at_rest).cwiseAbs() / at_rest.maxCoeff();
  if (!differences.allFinite()) return {};
  std::vector<std::size_t> kept(on_rest.size()), found;
  std::iota(kept.begin(), kept.end(), 0);
  while (found.size() < on_rest.size() / 4) {
    std::vector<double> medians;
    for (const auto k : kept) {
      std::vector<double> row;
      for (const auto other : kept)
        if (other != k) row.push_back(differences(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(other)));
      medians.push_back(median(row));
    }
    const auto worst = std::ranges::max_element(medians);
    if (*worst < kContradicts || *worst < kStandsOut * median(medians)) break;
    const auto at = kept.begin() + (worst - medians.begin());
    found.push_back(*at);
    kept.erase(at);
  }
  return found;
}

}  // namespace exmat::precompute
