#include "common/surface_io/polygon_faces.h"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <numeric>
#include <string>

#include "common/core/error.h"

namespace exmat {
namespace {

// Points that are compared with ears: for each corner of the file, and in any case. Faces of corners at random take the
// cube of their number.
constexpr std::size_t kTestsPerCorner = 10'000, kTests = 200'000'000;

constexpr double kRounding = 1e-12;          // of areas of a face of unit size
constexpr std::size_t kMostCompared = 4096;  // corners of a face whose edges are compared with each other

using Point = Eigen::Vector2d;

/// Twice the signed area of a triangle.
double area(const Point& a, const Point& b, const Point& c) {
  const Point u = b - a, v = c - a;
  return u[0] * v[1] - u[1] * v[0];
}

/// The corners in the plane of the face's Newell normal, counterclockwise, about the first and of about unit size.
std::vector<Point> flattened(const std::vector<Eigen::Vector3d>& corners) {
  Eigen::Vector3d normal = Eigen::Vector3d::Zero(), largest = normal;
  double size = 0;
  for (const auto& corner : corners) size = std::max(size, (corner - corners[0]).cwiseAbs().maxCoeff());
  const auto local = [&](std::size_t k) -> Eigen::Vector3d { return (corners[k] - corners[0]) / size; };
  for (std::size_t k = 2; k < corners.size(); ++k) {
    const Eigen::Vector3d area = local(k - 1).cross(local(k));
    normal += area;
    if (area.norm() > largest.norm()) largest = area;
  }
  if (normal.norm() <= kRounding) normal = largest;  // loops of a face that crosses itself may cancel each other
  const Eigen::Vector3d right = normal.unitOrthogonal(), up = normal.cross(right).normalized();
  std::vector<Point> points;
  for (std::size_t k = 0; k < corners.size(); ++k) points.emplace_back(local(k).dot(right), local(k).dot(up));
  return points;
}

/// True where the first corner sees all others: every triangle of its fan has an area. Also of a face without a plane.
bool fan_serves(const std::vector<Point>& points) {
  for (std::size_t k = 2; k < points.size(); ++k)
    if (area(points[0], points[k - 1], points[k]) <= kRounding) return false;
  return true;
}

/// True where two edges without a common corner cross.
bool crosses_itself(const std::vector<Point>& points) {
  const std::size_t count = points.size();
  const auto parts = [&](std::size_t edge, std::size_t other) {  // the ends of the other edge
    const Point &a = points[edge], &b = points[(edge + 1) % count];
    const double first = area(a, b, points[other]), second = area(a, b, points[(other + 1) % count]);
    return std::min(first, second) < -kRounding && std::max(first, second) > kRounding;
  };
  for (std::size_t edge = 0; edge + 2 < count; ++edge)
    for (std::size_t other = edge + 2; other < count - (edge == 0 ? 1 : 0); ++other)
      if (parts(edge, other) && parts(other, edge)) return true;
  return false;
}

/// The rest of a polygon while its ears are cut off.
class EarCutter {
 public:
  /// `tests` are those that are left, and counted down.
  EarCutter(const std::vector<Point>& points, std::size_t& tests)
      : points_(points), tests_(tests), rest_(points.size()) {
    std::iota(rest_.begin(), rest_.end(), std::size_t{0});
  }

  /// Triangles of indices into the points; none where the tests did not do.
  std::vector<std::array<std::size_t, 3>> cut() {
    std::vector<std::array<std::size_t, 3>> triangles;
    std::size_t at = 0, refused = 0;
    while (rest_.size() > 3) {
      if (tests_ < rest_.size()) return {};
      at %= rest_.size();
      // A face that crosses itself may have no ear: its next corner goes all the same.
      if (!is_ear(at) && ++refused <= rest_.size()) {
        ++at;
        continue;
      }
      refused = 0;
      triangles.push_back({before(at), rest_[at], after(at)});
      rest_.erase(rest_.begin() + static_cast<std::ptrdiff_t>(at));
      ++at;  // the next ear is elsewhere, which makes no fan of slivers
    }
    triangles.push_back({rest_[0], rest_[1], rest_[2]});
    return triangles;
  }

 private:
  std::size_t before(std::size_t at) const { return rest_[(at + rest_.size() - 1) % rest_.size()]; }
  std::size_t after(std::size_t at) const { return rest_[(at + 1) % rest_.size()]; }

  bool is_ear(std::size_t at) {
    const Point &a = points_[before(at)], &b = points_[rest_[at]], &c = points_[after(at)];
    if (!(area(a, b, c) > kRounding)) return false;
    tests_ -= rest_.size();
    return std::ranges::none_of(rest_, [&](std::size_t other) {
      const Point& p = points_[other];
      if (p == a || p == b || p == c) return false;
      return area(a, b, p) >= -kRounding && area(b, c, p) >= -kRounding && area(c, a, p) >= -kRounding;
    });
  }

  const std::vector<Point>& points_;
  std::size_t& tests_;
  std::vector<std::size_t> rest_;
};

}  // namespace

void PolygonFaces::add(const std::vector<std::int32_t>& polygon) {
  if (polygon.size() > 3) polygons_.emplace_back(triangles_.size(), polygon.size());
  for (std::size_t corner = 2; corner < polygon.size(); ++corner)
    triangles_.push_back({polygon[0], polygon[corner - 1], polygon[corner]});
}

std::vector<std::string> PolygonFaces::cut_ears(const std::vector<std::array<double, 3>>& vertices,
                                                const std::filesystem::path& file) {
  std::size_t crossing = 0;
  std::vector<std::int32_t> first_crossing;
  std::size_t tests = kTests;
  for (const auto& [first, count] : polygons_) tests += kTestsPerCorner * count;
  for (const auto& [first, count] : polygons_) {
    std::vector<std::int32_t> polygon{triangles_[first][0], triangles_[first][1]};
    for (std::size_t k = 0; k + 2 < count; ++k) polygon.push_back(triangles_[first + k][2]);
    std::vector<Eigen::Vector3d> corners;
    for (const auto corner : polygon) corners.emplace_back(vertices[static_cast<std::size_t>(corner)].data());
    const std::vector<Point> points = flattened(corners);
    if (fan_serves(points)) continue;
    const auto cut = EarCutter(points, tests).cut();
    if (cut.empty())
      throw InputError({file.string(), "faces", "faces whose edges do not cross",
                        "one of " + std::to_string(count) + " corners that takes too long to cut into triangles",
                        "export the mesh triangulated"});
    std::size_t next = first;
    for (const auto& [a, b, c] : cut) triangles_[next++] = {polygon[a], polygon[b], polygon[c]};
    if (points.size() <= kMostCompared && crosses_itself(points) && ++crossing == 1) first_crossing = polygon;
  }
  if (crossing == 0) return {};
  std::string corners;
  for (std::size_t k = 0; k < std::min<std::size_t>(first_crossing.size(), 8); ++k)
    corners += (k > 0 ? ", " : "") + std::to_string(first_crossing[k]);
  return {std::to_string(crossing) + (crossing == 1 ? " face whose edges cross is" : " faces whose edges cross are") +
          " cut into triangles that may not be meant, the first with vertices " + corners +
          (first_crossing.size() > 8 ? ", ..." : "") + ", from 0; mend the order of its corners"};
}

}  // namespace exmat
