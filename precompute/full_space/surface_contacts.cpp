#include "precompute/full_space/surface_contacts.h"

#include <algorithm>
#include <limits>

namespace exmat::precompute {
namespace {

runtime::Placement placement_of(const FullSpaceModel& model, const FullSpaceState& state) {
  runtime::Placement placement;
  if (!model.frame) return placement;
  const FittedFrame::Placement fitted = model.frame->place(state.q);
  placement.position = fitted.centre;
  placement.rotation = fitted.rotation;
  return placement;
}

/// World rows in the frame, R^T (x - origin).
VertexArray in_frame(const VertexArray& rows, const runtime::Placement& placement,
                     const Eigen::Vector3d& origin = Eigen::Vector3d::Zero()) {
  return (rows.rowwise() - origin.transpose()) * placement.rotation;
}

runtime::ContactSet set_of(const ContactData& data, const VertexArray& positions, const VertexArray& velocities) {
  ContactData moved;
  moved.vertices = data.vertices;
  moved.areas = data.areas;
  moved.positions.resize(data.positions.rows(), 3);
  moved.basis.resize(3 * data.positions.rows(), 1);
  for (Eigen::Index i = 0; i < data.positions.rows(); ++i) {
    moved.positions.row(i) = positions.row(data.vertices[i]);
    moved.basis.middleRows<3>(3 * i) = velocities.row(data.vertices[i]).transpose();
  }
  return runtime::ContactSet(moved);
}

runtime::BodySurface surface_of(const TriangleArray& triangles, const VertexArray& positions,
                                const VertexArray& velocities) {
  return {positions, velocities.reshaped<Eigen::RowMajor>(), triangles, Eigen::Vector3d::Zero()};
}

runtime::TouchingSurface touching_of(const runtime::ContactSet& set, const TriangleArray& triangles,
                                     const FullSpaceModel& model, const FullSpaceState& state,
                                     const runtime::Placement& placement) {
  return {set, surface_of(triangles, in_frame(world_positions(model, state), placement, placement.position),
                          in_frame(world_velocities(model, state), placement))};
}

}  // namespace

MovingSurface::MovingSurface(const ReducedModel& data, const FullSpaceModel& model, const FullSpaceState& state)
    : placement_(placement_of(model, state)),
      q_(Eigen::VectorXd::Zero(1)),
      v_(Eigen::VectorXd::Ones(1)),
      set_(set_of(*data.contact, in_frame(world_positions(model, state), placement_, placement_.position),
                  in_frame(world_velocities(model, state), placement_))),
      touching_(touching_of(set_, data.object->surface, model, state, placement_)),
      shape_(touching_.surface.make_shape()),
      triangles_(&data.object->surface) {
  touching_.surface.place(q_, shape_);
  const VertexArray positions = world_positions(model, state);
  for (Eigen::Index i = 0; i < positions.rows(); ++i) box_.extend(positions.row(i).transpose());
  speed_ = world_velocities(model, state).rowwise().norm().maxCoeff();
}

std::array<std::int32_t, 3> MovingSurface::corners(const Eigen::Vector3d& point, Eigen::Vector3d& shares) {
  const auto hit = touching_.surface.nearest(point, std::numeric_limits<double>::infinity(), shape_);
  shares = hit->barycentric;
  std::array<std::int32_t, 3> corners;
  for (int c = 0; c < 3; ++c) corners[static_cast<std::size_t>(c)] = (*triangles_)(hit->triangle, c);
  return corners;
}

SurfaceContacts::SurfaceContacts(const runtime::ContactLaw& law, MovingSurface& a, MovingSurface& b, double time_step,
                                 double margin, bool anew, const HeldVertices& held)
    : contact_(law), a_(a), b_(b) {
  const runtime::ContactSet& set = a.set();
  std::vector<int> number(static_cast<std::size_t>(set.vertices()));
  for (int i = 0; i < set.vertices(); ++i) number[static_cast<std::size_t>(set.data_index(i))] = i;
  HeldVertices ordered = held;
  for (auto& contact : ordered) contact.vertex = number[static_cast<std::size_t>(contact.vertex)];
  std::ranges::sort(ordered, {}, &runtime::HeldBodyContact::vertex);
  runtime::NearVertices near;
  contact_.gather(a.touching(), b.touching(), {time_step, margin, anew, ordered, b.shape(), near}, candidates_);
  for (const runtime::BodyCandidate& candidate : candidates_.all) {
    Place& place = places_.emplace_back();
    place.vertex = a.object_vertex(candidate.vertex);
    place.corners = b.corners(candidate.rest, place.shares);
  }
}

Eigen::Vector3d SurfaceContacts::between(std::size_t index, const VertexArray& a, const VertexArray& b) const {
  const Place& place = places_[index];
  Eigen::RowVector3d way = a.row(place.vertex);
  for (std::size_t c = 0; c < 3; ++c) way -= place.shares[static_cast<Eigen::Index>(c)] * b.row(place.corners[c]);
  return way.transpose();
}

double SurfaceContacts::evaluate(const VertexArray& a, const VertexArray& b, VertexArray& force_a,
                                 VertexArray& force_b) {
  double potential = 0;
  for (std::size_t i = 0; i < places_.size(); ++i) {
    const Place& place = places_[i];
    runtime::BodyCandidate& candidate = candidates_.all[i];
    const Eigen::Vector3d way = between(i, a, b);
    candidate.arm = a.row(place.vertex).transpose() - a_.placement().position;
    candidate.surface_arm = candidate.arm + a_.placement().position - b_.placement().position - way;
    potential += runtime::evaluate_contact(candidate.normal.dot(way), candidate.normal, way, candidate);
    force_a.row(place.vertex) += candidate.force.transpose();
    for (std::size_t c = 0; c < 3; ++c)
      force_b.row(place.corners[c]) -= place.shares[static_cast<Eigen::Index>(c)] * candidate.force.transpose();
  }
  return potential;
}

double SurfaceContacts::potential(const VertexArray& a, const VertexArray& b) const {
  double potential = 0;
  for (std::size_t i = 0; i < places_.size(); ++i) {
    const Eigen::Vector3d way = between(i, a, b);
    potential += runtime::contact_potential(candidates_.all[i], candidates_.all[i].normal.dot(way), way);
  }
  return potential;
}

void SurfaceContacts::refresh_friction(runtime::FrictionChange& change) {
  contact_.refresh_friction(candidates_, change);
}

std::vector<SurfaceContacts::Stiffness> SurfaceContacts::stiffness() const {
  std::vector<Stiffness> parts;
  for (std::size_t i = 0; i < places_.size(); ++i) {
    const runtime::BodyCandidate& candidate = candidates_.all[i];
    if (!candidate.is_loaded()) continue;
    const runtime::StiffnessFactors factors(candidate);
    const Eigen::Matrix3d matrix = factors.used() * factors.used().transpose();
    parts.push_back({places_[i].vertex, places_[i].corners, places_[i].shares, matrix});
  }
  return parts;
}

HeldVertices SurfaceContacts::held(const Eigen::Matrix3d& rotation_b) const {
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(1);
  runtime::Placement end = b_.placement();
  end.rotation = rotation_b;
  HeldVertices held;
  contact_.commit({a_.placement(), none}, {end, none}, candidates_, held);
  for (auto& contact : held) contact.vertex = a_.set().data_index(contact.vertex);
  return held;
}

int SurfaceContacts::touching() const {
  return static_cast<int>(
      std::ranges::count_if(candidates_.all, [](const auto& candidate) { return candidate.normal_force > 0; }));
}

}  // namespace exmat::precompute
