#include "runtime/sim/world/island_momenta.h"

#include <Eigen/LU>
#include <cmath>

namespace exmat::runtime {
namespace {

Eigen::Vector3d position_of(const WorldBody& body) { return body.model.frame->placement(body.state.frame).position; }

/// All bodies as one rigid one, where they are.
struct Together {
  explicit Together(std::span<WorldBody* const> bodies) {
    for (const WorldBody* const own : bodies) {
      const double own_mass = own->model.frame->inertia_of_momenta()->mass();
      mass += own_mass;
      centre += own_mass * position_of(*own);
    }
    centre /= mass;
    for (const WorldBody* const own : bodies) {
      const Eigen::Vector3d arm = position_of(*own) - centre;
      inertia += own->model.frame->inertia(own->workspace.frame, own->state.frame) +
                 own->model.frame->inertia_of_momenta()->mass() *
                     (arm.squaredNorm() * Eigen::Matrix3d::Identity() - arm * arm.transpose());
    }
  }

  /// About the centre, from those about another point.
  Eigen::Vector3d angular_momentum(const IslandMomenta& momenta) const {
    return momenta.total.angular - (centre - momenta.about).cross(momenta.total.linear);
  }
  FrameVelocity motion_of(const IslandMomenta& momenta) const {
    return {momenta.total.linear / mass, inertia.inverse() * angular_momentum(momenta)};
  }
  /// Of the rigid motion that has these momenta: no other has less.
  double energy_of(const IslandMomenta& momenta) const {
    const FrameVelocity motion = motion_of(momenta);
    return 0.5 * (momenta.total.linear.dot(motion.linear) + angular_momentum(momenta).dot(motion.angular));
  }

  double mass = 0;                                    ///< [kg]
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();   ///< of mass [m]
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();  ///< about it [kg m^2]
};

IslandMomenta momenta_of(std::span<WorldBody* const> bodies, const Eigen::Vector3d& about) {
  IslandMomenta sum{about, {}};
  for (const WorldBody* const own : bodies) {
    const std::optional<FrameMomenta> momenta = own->model.frame->momenta(own->state.frame);
    sum.total.linear += momenta->linear;
    sum.total.angular += momenta->angular + (position_of(*own) - about).cross(momenta->linear);
  }
  return sum;
}

/// Every velocity becomes `share` of what it is and that of the rigid motion of all, `added` about `centre`, beside it.
void add_motion(std::span<WorldBody* const> bodies, double share, const FrameVelocity& added,
                const Eigen::Vector3d& centre) {
  for (WorldBody* const own : bodies)
    own->step->add_motion(share, {added.at(position_of(*own) - centre), added.angular});
}

}  // namespace

std::optional<IslandMomenta> expected_momenta(std::span<WorldBody* const> bodies) noexcept {
  IslandMomenta sum{position_of(*bodies.front()), {}};
  for (const WorldBody* const own : bodies) {
    const std::optional<FrameMomenta> momenta = own->model.frame->expected_momenta(own->workspace.frame);
    if (!momenta || own->near().contact.candidate_count > 0) return std::nullopt;
    // The centre of mass goes along its momentum: where the step begins and where it ends give the same.
    sum.total.linear += momenta->linear;
    sum.total.angular += momenta->angular + (position_of(*own) - sum.about).cross(momenta->linear);
  }
  return sum;
}

void take_momenta(std::span<WorldBody* const> bodies, const IslandMomenta& momenta, double allowed) noexcept {
  const Together together(bodies);
  const IslandMomenta now = momenta_of(bodies, momenta.about);
  const IslandMomenta missing{momenta.about,
                              {momenta.total.linear - now.total.linear, momenta.total.angular - now.total.angular}};
  add_motion(bodies, 1, together.motion_of(missing), together.centre);
  double kinetic = 0;
  for (const WorldBody* const own : bodies) kinetic += own->model.frame->kinetic_energy(own->state.v, own->state.frame);
  if (kinetic <= allowed) return;
  const FrameVelocity rigid = together.motion_of(momenta);
  const double least = together.energy_of(momenta);
  const double share = least < allowed ? std::sqrt((allowed - least) / (kinetic - least)) : 0;
  add_motion(bodies, share, {(1 - share) * rigid.linear, (1 - share) * rigid.angular}, together.centre);
  if (least > allowed) add_motion(bodies, std::sqrt(std::max(0.0, allowed) / least), {}, together.centre);
}

}  // namespace exmat::runtime
