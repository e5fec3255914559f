#include "precompute/drawing/surface_picture.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <initializer_list>
#include <limits>
#include <map>
#include <utility>

namespace exmat::precompute {
namespace {

constexpr double kFilled = 0.9;               // of the side
constexpr std::size_t kMostTriangles = 5000;  // beyond these a picture is of pixels
constexpr int kSlices = 20;                   // of depth

/// A triangle that faces the viewer.
struct Facing {
  Eigen::Matrix3d corners;  // columns: pixels and depth
  std::string colour;

  double depth() const { return corners.row(2).mean(); }
};

/// Eight tones of each part, in three digits.
std::string hex(const Eigen::Vector3d& colour) {
  const auto part = [&](int i) { return 2 * std::clamp<long>(std::lround(7 * colour[i] / 255), 0, 7); };
  return fmt::format("#{:x}{:x}{:x}", part(0), part(1), part(2));
}

std::vector<Facing> facing(const PaintedSurface& surface, const PictureView& view) {
  std::vector<Facing> found;
  for (Eigen::Index k = 0; k < surface.triangles.rows(); ++k) {
    Facing one;
    for (int i = 0; i < 3; ++i) one.corners.col(i) = view(surface.vertices.row(surface.triangles(k, i)).transpose());
    const Eigen::Vector3d a = one.corners.col(1) - one.corners.col(0), b = one.corners.col(2) - one.corners.col(0);
    const double turned = a[1] * b[0] - a[0] * b[1];  // the picture's y points down
    if (!(turned > 0)) continue;
    const Eigen::Vector3d in_space =
        Eigen::Vector3d(a[0], a[1], view.scale * a[2]).cross(Eigen::Vector3d(b[0], b[1], view.scale * b[2]));
    one.colour = hex((0.5 + 0.5 * turned / in_space.norm()) * surface.colours[static_cast<std::size_t>(k)]);
    found.push_back(std::move(one));
  }
  return found;
}

/// Numbers of path data, with a blank only where it is needed.
std::string path_numbers(std::initializer_list<int> numbers) {
  std::string text;
  for (const int number : numbers) {
    if (!text.empty() && number >= 0) text += ' ';
    text += std::to_string(number);
  }
  return text;
}

/// Triangles of one colour, each from the first corner of the one before.
struct Path {
  std::string data = "M0 0";
  Eigen::Vector2i last = Eigen::Vector2i::Zero();

  void add(const Facing& triangle) {
    const auto corner = [&](int i) {
      return Eigen::Vector2i(std::lround(triangle.corners(0, i)), std::lround(triangle.corners(1, i)));
    };
    const Eigen::Vector2i p = corner(0), first = corner(1) - p, second = corner(2) - corner(1), move = p - last;
    if (first[0] * second[1] == first[1] * second[0]) return;  // nothing to be seen
    data +=
        "m" + path_numbers({move[0], move[1]}) + "l" + path_numbers({first[0], first[1], second[0], second[1]}) + "z";
    last = p;
  }
};

/// Slices from the farthest on, triangles of a colour together: many fewer bytes than one by one, and hidden by their
/// neighbours alike. Within a slice they keep the surface's order, in which each begins near the one before.
std::string slices(const std::vector<Facing>& triangles) {
  std::map<std::pair<std::size_t, std::string>, Path> paths;
  const auto [lowest, highest] = std::ranges::minmax(triangles, {}, &Facing::depth);
  const double low = lowest.depth(), size = std::max(highest.depth() - low, 1e-300);
  for (const Facing& one : triangles) {
    const double share = std::clamp((one.depth() - low) / size, 0.0, 0.999);
    paths[{static_cast<std::size_t>(share * kSlices), one.colour}].add(one);
  }
  std::string text;
  for (const auto& [look, path] : paths)
    text += fmt::format("<path fill=\"{0}\" stroke=\"{0}\" d=\"{1}\"/>\n", look.second, path.data);
  return "<g stroke-width=\".4\">\n" + text + "</g>\n";
}

/// Runs of pixels of one colour, of triangles from the farthest to the nearest, each over those behind it.
std::string pixels(std::vector<Facing> triangles) {
  std::ranges::stable_sort(triangles, {}, &Facing::depth);
  constexpr int kSide = kPictureSide, kHalf = kSide / 2;
  std::vector<std::string> colours(static_cast<std::size_t>(kSide) * kSide);
  for (const Facing& one : triangles) {
    const Eigen::Matrix<double, 2, 3> at = one.corners.topRows<2>().array() + kHalf;
    const auto first = [&](int i) { return std::max(0, static_cast<int>(at.row(i).minCoeff())); };
    const auto last = [&](int i) { return std::min(kSide - 1, static_cast<int>(at.row(i).maxCoeff())); };
    const auto side = [&](int p, int q, const Eigen::Vector2d& x) {
      return (at(1, q) - at(1, p)) * (x[0] - at(0, p)) - (at(0, q) - at(0, p)) * (x[1] - at(1, p));
    };
    for (int y = first(1); y <= last(1); ++y)
      for (int x = first(0); x <= last(0); ++x) {
        const Eigen::Vector2d middle(x + 0.5, y + 0.5);
        if (side(0, 1, middle) >= 0 && side(1, 2, middle) >= 0 && side(2, 0, middle) >= 0)
          colours[static_cast<std::size_t>(y) * kSide + static_cast<std::size_t>(x)] = one.colour;
      }
  }
  std::string text = "<g fill=\"none\" shape-rendering=\"crispEdges\">\n";
  for (int y = 0; y < kSide; ++y)
    for (int x = 0, end = 0; x < kSide; x = end) {
      const auto colour = [&](int column) -> const std::string& {
        return colours[static_cast<std::size_t>(y) * kSide + static_cast<std::size_t>(column)];
      };
      for (end = x + 1; end < kSide && colour(end) == colour(x);) ++end;
      if (!colour(x).empty())
        text +=
            fmt::format("<path stroke=\"{}\" d=\"M{} {}H{}\"/>\n", colour(x), x - kHalf, y - kHalf + 0.5, end - kHalf);
    }
  return text + "</g>\n";
}

}  // namespace

PictureView::PictureView(const Eigen::Matrix3d& its_axes, const std::vector<const VertexArray*>& shown)
    : axes(its_axes) {
  Eigen::Array2d low = Eigen::Array2d::Constant(std::numeric_limits<double>::infinity()), high = -low;
  for (const VertexArray* vertices : shown) {
    const auto seen = (*vertices * axes.topRows<2>().transpose()).eval();
    low = low.min(seen.colwise().minCoeff().transpose().array());
    high = high.max(seen.colwise().maxCoeff().transpose().array());
  }
  centre = 0.5 * (low + high);
  scale = kFilled * kPictureSide / std::max((high - low).maxCoeff(), 1e-300);
}

Eigen::Vector3d PictureView::operator()(const Eigen::Vector3d& x) const {
  const Eigen::Vector3d seen = axes * x;
  return {scale * (seen[0] - centre[0]), -scale * (seen[1] - centre[1]), seen[2]};
}

std::string surface_paths(const PaintedSurface& surface, const PictureView& view) {
  std::vector<Facing> triangles = facing(surface, view);
  if (triangles.empty()) return "";
  return triangles.size() > kMostTriangles ? pixels(std::move(triangles)) : slices(triangles);
}

std::string surface_svg(const PaintedSurface& surface, const PictureView& view) {
  constexpr int kHalf = kPictureSide / 2;
  return fmt::format("<svg width=\"{0}\" height=\"{0}\" viewBox=\"-{1} -{1} {0} {0}\">\n{2}</svg>\n", kPictureSide,
                     kHalf, surface_paths(surface, view));
}

std::string poses_svg(const TriangleArray& surface, const VertexArray& first, const VertexArray& second,
                      const Eigen::Vector3d& up, const std::string& id) {
  const Eigen::Vector3d side = up.unitOrthogonal();
  const Eigen::Vector3d towards = (Eigen::AngleAxisd(0.6, up) * side + 0.45 * up).normalized();
  Eigen::Matrix3d axes;
  axes.row(0) = up.cross(towards).normalized();
  axes.row(2) = towards;
  axes.row(1) = towards.cross(axes.row(0).transpose());
  const PictureView view(axes, {&first, &second});
  const auto group = [&](const char* name, const VertexArray& pose, const Eigen::Vector3d& colour, int column) {
    return fmt::format("<g id=\"{}{}\" transform=\"translate({} {})\">\n{}</g>\n", id, name,
                       kPictureSide * (2 * column + 1) / 2, kPictureSide / 2,
                       surface_paths({pose, surface, colour}, view));
  };
  return fmt::format("<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0} {1}\" width=\"{0}\">\n",
                     3 * kPictureSide, kPictureSide) +
         group("full", first, {70, 130, 210}, 0) + group("reduced", second, {225, 130, 60}, 1) +
         fmt::format(
             "<use href=\"#{0}full\" x=\"{1}\"/><use href=\"#{0}reduced\" x=\"{2}\" opacity=\"0.55\"/>\n</svg>\n", id,
             2 * kPictureSide, kPictureSide);
}

}  // namespace exmat::precompute
