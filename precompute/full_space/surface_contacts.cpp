#include "precompute/full_space/surface_contacts.h"

#include <algorithm>

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

runtime::MovingSurface surface_of(const ReducedModel& data) {
  const runtime::ContactSet set(*data.contact);
  const VertexArray& rest = data.object->mesh.vertices;
  return {set, {set, {rest, RowMatrix::Zero(rest.size(), 1), data.object->surface, Eigen::Vector3d::Zero()}}};
}

}  // namespace

MovingSurface::MovingSurface(const ReducedModel& data, const FullSpaceModel& model, const FullSpaceState& state)
    : placement_(placement_of(model, state)), surface_(surface_of(data)) {
  const VertexArray positions = world_positions(model, state), velocities = world_velocities(model, state);
  surface_.place(
      placement_, [&](int vertex) -> Eigen::Vector3d { return positions.row(vertex); },
      [&](int vertex) -> Eigen::Vector3d { return velocities.row(vertex); });
  for (const auto& position : positions.rowwise()) box_.extend(position.transpose());
}

SurfaceContacts::SurfaceContacts(const runtime::ContactLaw& law, MovingSurface& a, MovingSurface& b, double time_step,
                                 double margin, bool anew, const HeldVertices& held)
    : contact_(law), a_(a), b_(b) {
  runtime::NearVertices near;
  contact_.gather(a.touching(), b.touching(), {time_step, margin, anew, held, b.shape(), near}, candidates_);
  for (std::size_t i = 0; i < candidates_.all.size(); ++i) {
    const auto& [triangle, shares] = candidates_.places[i];
    Place& place = places_.emplace_back();
    place.vertex = a.object_vertex(candidates_.all[i].vertex);
    place.shares = shares;
    for (int c = 0; c < 3; ++c) place.corners[static_cast<std::size_t>(c)] = b.corner(triangle, c);
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
  return held;
}

int SurfaceContacts::touching() const {
  return static_cast<int>(
      std::ranges::count_if(candidates_.all, [](const auto& candidate) { return candidate.normal_force > 0; }));
}

}  // namespace exmat::precompute
