#include "common/config/vertex_selection.h"

#include <Eigen/Core>
#include <algorithm>
#include <fmt/format.h>
#include <utility>

#include "common/config/vertex_ids.h"
#include "common/core/error.h"
#include "common/core/nearest_name.h"
#include "common/mesh/geometry.h"

namespace exmat {
namespace {

std::string text_of(const Eigen::RowVector3d& point) {
  return fmt::format("({:.6g}, {:.6g}, {:.6g})", point[0], point[1], point[2]);
}

std::string bounding_box(const VertexArray& points) {
  if (points.rows() == 0) return "the mesh is empty";
  return fmt::format("the mesh lies in {} to {}", text_of(points.colwise().minCoeff()),
                     text_of(points.colwise().maxCoeff()));
}

template <typename Predicate>
std::vector<std::int32_t> numbers_where(Eigen::Index count, Predicate is_inside) {
  std::vector<std::int32_t> numbers;
  for (Eigen::Index v = 0; v < count; ++v)
    if (is_inside(v)) numbers.push_back(static_cast<std::int32_t>(v));
  return numbers;
}

/// The name of a part that was meant, or those that there are.
std::string advice_on(const std::string& name, const std::map<std::string, FlagVector>& parts) {
  std::vector<std::string> names;
  for (const auto& [known, flags] : parts) names.push_back(known);
  if (names.empty()) return "it has none";
  if (const std::string nearest = nearest_name(name, names); !nearest.empty())
    return fmt::format("did you mean \"{}\"?", nearest);
  return fmt::format("it has \"{}\"", fmt::join(names, "\", \""));
}

class Selector {
 public:
  explicit Selector(const SelectablePoints& from) : from_(from), points_(from.points) {}

  std::vector<std::int32_t> operator()(const BoxSelection& box) const {
    const Eigen::RowVector3d min(box.min.data()), max(box.max.data());
    return require_some(numbers_where(points_.rows(),
                                      [&](Eigen::Index v) {
                                        return (points_.row(v).array() >= min.array()).all() &&
                                               (points_.row(v).array() <= max.array()).all();
                                      }),
                        fmt::format("the box {} to {}", text_of(min), text_of(max)));
  }

  std::vector<std::int32_t> operator()(const SphereSelection& sphere) const {
    const Eigen::RowVector3d centre(sphere.centre.data());
    return require_some(
        numbers_where(points_.rows(),
                      [&](Eigen::Index v) { return (points_.row(v) - centre).norm() <= sphere.radius; }),
        fmt::format("the sphere about {} of radius {:.6g}", text_of(centre), sphere.radius));
  }

  std::vector<std::int32_t> operator()(const IdSelection& selection) const {
    std::vector<std::int32_t> numbers;
    for (const std::int64_t id : selection.ids) {
      if (id < 0 || id >= points_.rows())
        throw InputError({from_.file, place("ids"), fmt::format("0-based {} ids below {}", from_.noun, points_.rows()),
                          std::to_string(id), ""});
      numbers.push_back(static_cast<std::int32_t>(id));
    }
    return require_some(std::move(numbers), "ids");
  }

  std::vector<std::int32_t> operator()(const FileSelection& selection) const {
    std::vector<std::int32_t> numbers;
    for (const std::int64_t id : read_vertex_ids(selection.file, points_.rows(), from_.noun))
      numbers.push_back(static_cast<std::int32_t>(id));
    std::ranges::sort(numbers);
    return numbers;
  }

  std::vector<std::int32_t> operator()(const PartSelection& selection) const {
    require_surface("part", fmt::format("\"{}\"", selection.name));
    const auto found = from_.marks->parts.find(selection.name);
    if (found == from_.marks->parts.end())
      throw InputError({from_.file, place("part"), "a part of " + from_.surface, fmt::format("\"{}\"", selection.name),
                        advice_on(selection.name, from_.marks->parts)});
    return require_nearest(numbers_where(points_.rows(), [&](Eigen::Index v) { return found->second[v] != 0; }), "part",
                           fmt::format("\"{}\"", selection.name));
  }

  std::vector<std::int32_t> operator()(const ColourSelection& selection) const {
    require_surface("color", "a color");
    const VertexArray& colours = from_.marks->colours;
    if (colours.rows() == 0)
      throw InputError({from_.file, place("color"), "colors of the vertices of " + from_.surface, "none",
                        "export them, or name a part"});
    const Eigen::RowVector3d wanted(selection.colour.data());
    return require_nearest(numbers_where(points_.rows(),
                                         [&](Eigen::Index v) {
                                           return (colours.row(v) - wanted).cwiseAbs().maxCoeff() <= selection.within;
                                         }),
                           "color", text_of(wanted));
  }

  std::vector<std::int32_t> operator()(const PointSelection& selection) const {
    const Eigen::RowVector3d point(selection.point.data());
    Eigen::Index nearest = 0;
    const double distance = (points_.rowwise() - point).rowwise().norm().minCoeff(&nearest);
    if (distance > bounding_box_diagonal(points_))
      throw InputError({from_.file, place("point"), "a point no farther from the mesh than it is large [m]",
                        fmt::format("{}, {:.3g} m off", text_of(point), distance), bounding_box(points_)});
    return {static_cast<std::int32_t>(nearest)};
  }

 private:
  std::string place(const std::string& member) const {
    return from_.place.empty() ? member : from_.place + "/" + member;
  }

  void require_surface(const char* member, const std::string& found) const {
    if (from_.marks == nullptr)
      throw InputError({from_.file, place(member), "parts and colors of an object that is given as object.surface",
                        found, "choose a box, a sphere, a point or ids"});
  }

  std::vector<std::int32_t> require_some(std::vector<std::int32_t> numbers, const std::string& what) const {
    if (numbers.empty())
      throw InputError({from_.file, from_.place.empty() ? what : from_.place + ", " + what,
                        fmt::format("at least one {} of the mesh", from_.noun), "none", bounding_box(points_)});
    std::ranges::sort(numbers);
    numbers.erase(std::unique(numbers.begin(), numbers.end()), numbers.end());
    return numbers;
  }

  std::vector<std::int32_t> require_nearest(std::vector<std::int32_t> numbers, const char* member,
                                            const std::string& found) const {
    if (numbers.empty())
      throw InputError({from_.file, place(member), "a part of the surface that some of the cage is nearest to", found,
                        "choose a larger part, or more cells"});
    return numbers;
  }

  const SelectablePoints& from_;
  const VertexArray& points_;
};

}  // namespace

bool needs_marks(const VertexSelection& selection) {
  return std::holds_alternative<PartSelection>(selection) || std::holds_alternative<ColourSelection>(selection);
}

std::vector<std::int32_t> select_points(const SelectablePoints& from, const VertexSelection& selection) {
  return std::visit(Selector(from), selection);
}

}  // namespace exmat
