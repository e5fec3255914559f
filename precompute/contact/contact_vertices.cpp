#include "precompute/contact/contact_vertices.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <fmt/format.h>

#include "common/mesh/farthest_points.h"

namespace exmat::precompute {
namespace {

// Ascending.
std::vector<Eigen::Index> candidates(const ObjectData& object, const Eigen::VectorXd& areas,
                                     const FlagVector& may_touch) {
  std::vector<Eigen::Index> ids;
  for (Eigen::Index v = 0; v < areas.size(); ++v)
    if (areas[v] > 0 && object.fixed[v] == 0 && may_touch[v] != 0) ids.push_back(v);
  return ids;
}

// Each point's area goes to the nearest of the chosen ones, given in ascending order.
Eigen::VectorXd shared_areas(const VertexArray& points, const Eigen::VectorXd& areas,
                             const std::vector<Eigen::Index>& chosen) {
  const VertexArray centres = points(chosen, Eigen::all);
  Eigen::VectorXd shares = Eigen::VectorXd::Zero(centres.rows());
  for (Eigen::Index i = 0; i < points.rows(); ++i) {
    Eigen::Index nearest = 0;
    (centres.rowwise() - points.row(i)).rowwise().squaredNorm().minCoeff(&nearest);
    shares[nearest] += areas[i];
  }
  return shares;
}

}  // namespace

Eigen::VectorXd vertex_areas(const ObjectData& object) {
  Eigen::VectorXd areas = Eigen::VectorXd::Zero(object.mesh.vertex_count());
  for (const auto& triangle : object.surface.rowwise()) {
    const Eigen::RowVector3d origin = object.mesh.vertices.row(triangle[0]);
    const Eigen::RowVector3d first = object.mesh.vertices.row(triangle[1]) - origin;
    const Eigen::RowVector3d second = object.mesh.vertices.row(triangle[2]) - origin;
    const double third = first.cross(second).norm() / 6;
    for (const std::int32_t corner : triangle) areas[corner] += third;
  }
  return areas;
}

ContactData contact_data(const ObjectData& object, const RowMatrix& basis, const FlagVector& may_touch,
                         std::optional<int> count) {
  const Eigen::VectorXd areas = vertex_areas(object);
  const std::vector<Eigen::Index> ids = candidates(object, areas, may_touch);
  const VertexArray points = object.mesh.vertices(ids, Eigen::all);
  const Eigen::VectorXd own_areas = areas(ids);
  std::vector<Eigen::Index> chosen = farthest_points(points, count.value_or(kContactVertices));
  std::ranges::sort(chosen);

  ContactData contact;
  contact.positions = points(chosen, Eigen::all);
  contact.areas = chosen.size() < ids.size() ? shared_areas(points, own_areas, chosen) : own_areas;
  const auto k = static_cast<Eigen::Index>(chosen.size());
  contact.vertices.resize(k);
  contact.basis.resize(3 * k, basis.cols());
  for (Eigen::Index i = 0; i < k; ++i) {
    const Eigen::Index vertex = ids[static_cast<std::size_t>(chosen[static_cast<std::size_t>(i)])];
    contact.vertices[i] = static_cast<std::int32_t>(vertex);
    contact.basis.middleRows<3>(3 * i) = basis.middleRows<3>(3 * vertex);
  }
  return contact;
}

std::string contact_summary(const ObjectData& object, const FlagVector& may_touch, const ContactData& contact) {
  const auto all = std::ssize(candidates(object, vertex_areas(object), may_touch));
  const Eigen::Index taken = contact.areas.size();
  if (taken == all) return fmt::format("contact: all {} surface vertices", all);
  return fmt::format("contact: a sample of {} of {} surface vertices; \"contact\": {{ \"count\": {} }} takes all",
                     taken, all, all);
}

}  // namespace exmat::precompute
