#include "precompute/shape_space/region_window.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <queue>
#include <utility>
#include <vector>

#include "common/mesh/geometry.h"
#include "common/mesh/nearest_point.h"

namespace exmat::precompute {
namespace {

// The region's tets, whose corners are all inside, and those across its border.
struct Cut {
  TetMesh body, across;
};

Cut cut_of(const TetMesh& mesh, const FlagVector& inside) {
  std::vector<Eigen::Index> body, across;
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t) {
    const FlagVector corners = inside(mesh.tets.row(t).transpose());
    if (corners.any()) (corners.all() ? body : across).push_back(t);
  }
  return {{mesh.vertices, mesh.tets(body, Eigen::all)}, {mesh.vertices, mesh.tets(across, Eigen::all)}};
}

// The region's vertices that share a tet with others.
FlagVector border_of(const Cut& cut, const FlagVector& inside) {
  FlagVector border = FlagVector::Zero(inside.size());
  for (const auto vertex : cut.across.tets.reshaped()) border[vertex] = inside[vertex];
  return border;
}

// Lowers distances [n] to where a path from the border comes by, and raises them to the farthest that it cannot avoid:
// a hand that hangs beside the hip is no nearer to the border of its arm than the way along the arm leads.
class WayFromBorder {
 public:
  explicit WayFromBorder(const TetMesh& body) : neighbours_(static_cast<std::size_t>(body.vertex_count())) {
    for (const auto& tet : body.tets.rowwise())
      for (const auto from : tet)
        for (const auto to : tet)
          if (from != to) neighbours_[static_cast<std::size_t>(from)].push_back(to);
  }

  // The least over all paths of the farthest on a path, by Dijkstra's order.
  Eigen::VectorXd farthest(const Eigen::VectorXd& distances, const FlagVector& border) {
    using Step = std::pair<double, std::int32_t>;
    std::priority_queue<Step, std::vector<Step>, std::greater<>> next;
    Eigen::VectorXd result = Eigen::VectorXd::Constant(distances.size(), std::numeric_limits<double>::infinity());
    const auto reach = [&](std::int32_t vertex, double way) {
      if (way >= result[vertex]) return;
      result[vertex] = way;
      next.emplace(way, vertex);
    };
    for (Eigen::Index v = 0; v < border.size(); ++v)
      if (border[v] != 0) reach(static_cast<std::int32_t>(v), 0);
    while (!next.empty()) {
      const auto [way, vertex] = next.top();
      next.pop();
      if (way > result[vertex]) continue;
      for (const auto to : neighbours_[static_cast<std::size_t>(vertex)]) reach(to, std::max(way, distances[to]));
    }
    return result;
  }

 private:
  std::vector<std::vector<std::int32_t>> neighbours_;
};

// [n] of the region's vertices from its border; zero elsewhere.
Eigen::VectorXd border_distances(const Cut& cut, const FlagVector& border, const std::vector<Eigen::Index>& beyond) {
  Eigen::VectorXd straight = Eigen::VectorXd::Zero(border.size()), distances = straight;
  // The nearest point of the tets across is, seen from inside, on one of the border's faces.
  straight(beyond) = nearest_points(cut.across, cut.body.vertices(beyond, Eigen::all)).distances;
  const Eigen::VectorXd way = WayFromBorder(cut.body).farthest(straight, border);
  distances(beyond) = way.array().isFinite().select(way, straight)(beyond);  // no way leads to another body's vertices
  return distances;
}

double smooth_step(double t) {
  const double within = std::clamp(t, 0.0, 1.0);
  return within * within * (3 - 2 * within);
}

double slope_of_step(double t) { return t > 0 && t < 1 ? 6 * t * (1 - t) : 0; }

// Integrals over a tet of the step's slope times the shape functions. Vertices alone would not do: where layers are
// few, the middle of the band would lie where the diagonals of the tets put it, and what balances a force would bend
// the body.
class SlopeIntegral {
 public:
  // `steps` are the distances at the corners over the band's width.
  Eigen::Vector4d over(const Eigen::Vector4d& steps, double volume) {
    total_.setZero();
    add({Eigen::Matrix4d::Identity(), steps, volume});
    return total_;
  }

 private:
  struct Piece {
    Eigen::Matrix4d shares;  // of the tet's corners in the piece's, a row each
    Eigen::Vector4d steps;
    double volume;
  };

  // Halves pieces until the slope is nearly linear in each.
  void add(const Piece& piece) {
    Eigen::Index low = 0, high = 0;
    const double least = piece.steps.minCoeff(&low);
    if (least >= 1) return;
    if (piece.steps.maxCoeff(&high) - least <= kFine) return add_fine(piece);
    for (const Eigen::Index replaced : {low, high}) {
      Piece half = piece;
      half.volume /= 2;
      half.shares.row(replaced) = (piece.shares.row(low) + piece.shares.row(high)) / 2;
      half.steps[replaced] = (piece.steps[low] + piece.steps[high]) / 2;
      add(half);
    }
  }

  // Keast's rule of four points, exact to degree 2.
  void add_fine(const Piece& piece) {
    const double far = (5 - std::sqrt(5.0)) / 20;
    for (int k = 0; k < 4; ++k) {
      Eigen::RowVector4d point = Eigen::RowVector4d::Constant(far);
      point[k] = 1 - 3 * far;
      total_ += piece.volume / 4 * slope_of_step(point.dot(piece.steps)) * (point * piece.shares).transpose();
    }
  }

  static constexpr double kFine = 0.25;
  Eigen::Vector4d total_;
};

// [n] of the region's vertices, of distances over the width of the band.
Eigen::VectorXd slope_integrals(const TetMesh& body, const Eigen::VectorXd& steps) {
  const Eigen::VectorXd volumes = tet_volumes(body);
  Eigen::VectorXd integrals = Eigen::VectorXd::Zero(steps.size());
  SlopeIntegral integral;
  for (Eigen::Index t = 0; t < body.tet_count(); ++t) {
    const auto corners = body.tets.row(t).transpose();
    integrals(corners) += integral.over(steps(corners), volumes[t]);
  }
  return integrals;
}

}  // namespace

Eigen::VectorXd lumped_volumes(const TetMesh& mesh) {
  const Eigen::VectorXd volumes = tet_volumes(mesh);
  Eigen::VectorXd lumped = Eigen::VectorXd::Zero(mesh.vertex_count());
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t)
    for (const auto vertex : mesh.tets.row(t)) lumped[vertex] += volumes[t] / 4;
  return lumped;
}

RegionWindow region_window(const TetMesh& mesh, const FlagVector& inside) {
  const Cut cut = cut_of(mesh, inside);
  const FlagVector border = border_of(cut, inside);
  std::vector<Eigen::Index> beyond;
  for (Eigen::Index v = 0; v < inside.size(); ++v)
    if (inside[v] != 0 && border[v] == 0) beyond.push_back(v);
  RegionWindow window{inside.cast<double>(), lumped_volumes(mesh).cwiseProduct(border.cast<double>())};
  if (beyond.empty() || !border.any()) return window;

  const Eigen::VectorXd distances = border_distances(cut, border, beyond), volumes = lumped_volumes(cut.body);
  const Eigen::VectorXd steps = distances * volumes.sum() / (kBandShare * distances.dot(volumes));
  window.values = steps.unaryExpr(&smooth_step);
  window.band = slope_integrals(cut.body, steps);
  return window;
}

}  // namespace exmat::precompute
