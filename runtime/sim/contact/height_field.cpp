#include "runtime/sim/contact/height_field.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace exmat::runtime {
namespace {

constexpr double kNoDistance = 1e-12;  // of a cell: below it the face says which way is out

constexpr double kRounded = 1e-12;  // of a distance, and more

/// The cell of a coordinate, its border belongs to the last.
int cell_of(double coordinate, double spacing, int cells) {
  return static_cast<int>(std::clamp(coordinate / spacing, 0.0, cells - 0.5));
}

double beyond(double coordinate, double low, double high) {
  return std::max({low - coordinate, coordinate - high, 0.0});
}

}  // namespace

HeightField::HeightField(RowMatrix heights, const Eigen::Vector2d& spacing)
    : heights_(std::move(heights)),
      spacing_(spacing),
      width_(spacing[0] * static_cast<double>(heights_.cols() - 1)),
      depth_(spacing[1] * static_cast<double>(heights_.rows() - 1)) {
  Level cells{static_cast<int>(heights_.cols()) - 1, static_cast<int>(heights_.rows()) - 1, {}, {}};
  for (int row = 0; row < cells.rows; ++row)
    for (int column = 0; column < cells.columns; ++column) {
      const auto corners = heights_.block<2, 2>(row, column);
      cells.lowest.push_back(corners.minCoeff());
      cells.highest.push_back(corners.maxCoeff());
    }
  levels_.push_back(std::move(cells));
  while (levels_.back().columns > 1 || levels_.back().rows > 1) {
    const Level& fine = levels_.back();
    Level coarse{(fine.columns + 1) / 2, (fine.rows + 1) / 2, {}, {}};
    for (int row = 0; row < coarse.rows; ++row)
      for (int column = 0; column < coarse.columns; ++column) {
        double low = std::numeric_limits<double>::infinity(), high = -low;
        for (int y = 2 * row; y < std::min(2 * row + 2, fine.rows); ++y)
          for (int x = 2 * column; x < std::min(2 * column + 2, fine.columns); ++x) {
            const auto at =
                static_cast<std::size_t>(y) * static_cast<std::size_t>(fine.columns) + static_cast<std::size_t>(x);
            low = std::min(low, fine.lowest[at]);
            high = std::max(high, fine.highest[at]);
          }
        coarse.lowest.push_back(low);
        coarse.highest.push_back(high);
      }
    levels_.push_back(std::move(coarse));
  }
}

double HeightField::height_at(double x, double y) const noexcept {
  const double u = std::clamp(x, 0.0, width_), v = std::clamp(y, 0.0, depth_);
  const int column = cell_of(u, spacing_[0], levels_.front().columns);
  const int row = cell_of(v, spacing_[1], levels_.front().rows);
  const double s = u / spacing_[0] - column, t = v / spacing_[1] - row;
  const double here = heights_(row, column), across = heights_(row + 1, column + 1);
  if (s >= t) {
    const double right = heights_(row, column + 1);
    return here + s * (right - here) + t * (across - right);
  }
  const double up = heights_(row + 1, column);
  return here + t * (up - here) + s * (across - up);
}

double HeightField::squared_distance(int level, int column, int row, const Eigen::Vector3d& point) const noexcept {
  const Level& blocks = levels_[static_cast<std::size_t>(level)];
  const auto at =
      static_cast<std::size_t>(row) * static_cast<std::size_t>(blocks.columns) + static_cast<std::size_t>(column);
  const double size = static_cast<double>(1 << level);
  const double x = beyond(point[0], column * size * spacing_[0], std::min((column + 1) * size * spacing_[0], width_));
  const double y = beyond(point[1], row * size * spacing_[1], std::min((row + 1) * size * spacing_[1], depth_));
  const double z = beyond(point[2], blocks.lowest[at], blocks.highest[at]);
  return x * x + y * y + z * z;
}

std::array<Eigen::Vector3d, 3> HeightField::corners(Eigen::Index triangle) const noexcept {
  const auto cell = static_cast<int>(triangle / 2), columns = levels_.front().columns;
  const int column = cell % columns, row = cell / columns;
  const Eigen::Vector3d here = corner(column, row), across = corner(column + 1, row + 1);
  if (triangle % 2 == 0) return {here, corner(column + 1, row), across};
  return {here, across, corner(column, row + 1)};
}

TrianglePoint HeightField::nearest_on(int triangle, const Eigen::Vector3d& point) const noexcept {
  const auto [a, b, c] = corners(triangle);
  return nearest_on_triangle(point, a, b, c);
}

/// Searches within `reach`, nearer blocks first.
template <HeightField::Search kSearch>
HeightField::Found HeightField::search(const Eigen::Vector3d& point, double reach) const noexcept {
  struct Waiting {
    int level, column, row;
    double bound;  // on the squared distance
  };
  Waiting waiting[128];  // three of each of at most 31 levels, and four
  int count = 0;
  Found best;
  best.on.squared_distance = best.second = reach * reach;
  const double& limit = kSearch == Search::kTwoNearest ? best.second : best.on.squared_distance;
  const int top = static_cast<int>(levels_.size()) - 1;
  waiting[count++] = {top, 0, 0, squared_distance(top, 0, 0, point)};
  while (count > 0) {
    const Waiting block = waiting[--count];
    if (block.bound > limit) continue;
    if (block.level == 0) {
      const int first = 2 * (block.row * levels_.front().columns + block.column);
      for (const int triangle : {first, first + 1}) {
        const TrianglePoint here = nearest_on(triangle, point);
        const double square = here.squared_distance;
        const bool nearer = square < best.on.squared_distance ||
                            (square == best.on.squared_distance && (best.triangle < 0 || triangle < best.triangle));
        if (nearer) {
          if (best.triangle >= 0) best.second = best.on.squared_distance;
          best.triangle = triangle;
          best.on = here;
          if (kSearch == Search::kAny) return best;
        } else if (square < best.second) {
          best.second = square;
        }
      }
      continue;
    }
    const Level& fine = levels_[static_cast<std::size_t>(block.level) - 1];
    const int start = count;
    for (int y = 2 * block.row; y < std::min(2 * block.row + 2, fine.rows); ++y)
      for (int x = 2 * block.column; x < std::min(2 * block.column + 2, fine.columns); ++x) {
        const Waiting child{block.level - 1, x, y, squared_distance(block.level - 1, x, y, point)};
        if (child.bound > limit) continue;
        int place = count++;
        for (; place > start && waiting[place - 1].bound < child.bound; --place) waiting[place] = waiting[place - 1];
        waiting[place] = child;
      }
  }
  return best;
}

Eigen::Vector3d HeightField::normal_of(int triangle) const noexcept {
  const int cell = triangle / 2, columns = levels_.front().columns;
  const int column = cell % columns, row = cell / columns;
  const Eigen::Vector3d across = corner(column + 1, row + 1) - corner(column, row);
  const Eigen::Vector3d normal = triangle % 2 == 0 ? (corner(column + 1, row) - corner(column, row)).cross(across)
                                                   : across.cross(corner(column, row + 1) - corner(column, row));
  return normal.normalized();
}

bool HeightField::is_below(const Eigen::Vector3d& point) const noexcept {
  return point[0] >= 0 && point[0] <= width_ && point[1] >= 0 && point[1] <= depth_ &&
         point[2] < height_at(point[0], point[1]);
}

SurfacePoint HeightField::nearest(const Eigen::Vector3d& point) const noexcept {
  constexpr double kAnywhere = std::numeric_limits<double>::infinity();
  if (!point.allFinite()) return {kAnywhere, Eigen::Vector3d::UnitZ(), point};
  return surface_of(point, search<Search::kNearest>(point, kAnywhere));
}

SurfacePoint HeightField::nearest(const Eigen::Vector3d& point, NearestHint& hint) const noexcept {
  constexpr double kAnywhere = std::numeric_limits<double>::infinity();
  if (!point.allFinite()) return {kAnywhere, Eigen::Vector3d::UnitZ(), point};
  if (hint.triangle >= 0) {
    const Found same{hint.triangle, nearest_on(hint.triangle, point)};
    if (hint.holds(point, std::sqrt(same.on.squared_distance))) return surface_of(point, same);
  }
  const Found best = search<Search::kTwoNearest>(point, kAnywhere);
  hint = {best.triangle, (1 - kRounded) * std::sqrt(best.second), point};
  return surface_of(point, best);
}

SurfacePoint HeightField::surface_of(const Eigen::Vector3d& point, const Found& found) const noexcept {
  const double side = is_below(point) ? -1 : 1;
  const double distance = std::sqrt(found.on.squared_distance);
  SurfacePoint surface{side * distance, Eigen::Vector3d::UnitZ(), found.on.point};
  const Eigen::Vector3d away = point - found.on.point;
  const Eigen::Vector3d up = normal_of(found.triangle);
  const bool within = (found.on.barycentric.array() > 0).all() && side * up.dot(away) >= 0;
  if (within || distance <= kNoDistance * spacing_.maxCoeff())
    surface.normal = up;
  else
    surface.normal = side / distance * away;
  return surface;
}

bool HeightField::may_be_within(const Eigen::Vector3d& point, double radius) const noexcept {
  if (!point.allFinite() || is_below(point)) return true;
  return radius >= 0 && search<Search::kAny>(point, radius).triangle >= 0;
}

std::optional<double> HeightField::entry(const Ray& ray, double most) const noexcept {
  struct Waiting {
    int level, column, row;
  };
  Waiting waiting[128];  // three of each of at most 31 levels, and four
  int count = 0;
  std::optional<double> first;
  waiting[count++] = {static_cast<int>(levels_.size()) - 1, 0, 0};
  while (count > 0) {
    const Waiting block = waiting[--count];
    const Level& blocks = levels_[static_cast<std::size_t>(block.level)];
    const auto at = static_cast<std::size_t>(block.row) * static_cast<std::size_t>(blocks.columns) +
                    static_cast<std::size_t>(block.column);
    const double wide = static_cast<double>(1 << block.level) * spacing_[0];
    const double deep = static_cast<double>(1 << block.level) * spacing_[1];
    const auto bound = box_entry(
        ray, {block.column * wide, block.row * deep, blocks.lowest[at]},
        {std::min((block.column + 1) * wide, width_), std::min((block.row + 1) * deep, depth_), blocks.highest[at]});
    if (!bound || *bound > most) continue;
    if (block.level == 0) {
      for (const int triangle : {2 * static_cast<int>(at), 2 * static_cast<int>(at) + 1}) {
        const auto [a, b, c] = corners(triangle);
        const auto hit = triangle_hit(ray, a, b, c);
        if (hit && hit->distance <= most && normal_of(triangle).dot(ray.direction) < 0) first = most = hit->distance;
      }
      continue;
    }
    const Level& fine = levels_[static_cast<std::size_t>(block.level) - 1];
    for (int y = 2 * block.row; y < std::min(2 * block.row + 2, fine.rows); ++y)
      for (int x = 2 * block.column; x < std::min(2 * block.column + 2, fine.columns); ++x)
        waiting[count++] = {block.level - 1, x, y};
  }
  return first;
}

}  // namespace exmat::runtime
