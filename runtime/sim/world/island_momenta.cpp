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
      inertia += own->inertia() + own->model.frame->inertia_of_momenta()->mass() *
                                      (arm.squaredNorm() * Eigen::Matrix3d::Identity() - arm * arm.transpose());
    }
  }

  /// About the centre, from those about another point.
  Eigen::Vector3d angular_momentum(const IslandMomenta& momenta) const {
    return momenta.total.angular - (centre - momenta.about).cross(momenta.total.linear);
  }
  FrameVelocity motion_of(const IslandMomenta& momenta) const {
    FrameVelocity motion{momenta.total.linear / mass, inertia.inverse() * angular_momentum(momenta)};
    if (!motion.angular.allFinite()) motion.angular.setZero();  // the inertia overflows: they are too far apart to turn
    return motion;
  }
  /// Energy of the rigid motion that has these momenta: no other has less.
  double energy_of(const IslandMomenta& momenta) const {
    const FrameVelocity motion = motion_of(momenta);
    return 0.5 * (momenta.total.linear.dot(motion.linear) + angular_momentum(momenta).dot(motion.angular));
  }

  double mass = 0;                                    ///< [kg]
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();   ///< centre of mass [m]
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
  for (WorldBody* const own : bodies) own->add_motion(share, {added.at(position_of(*own) - centre), added.angular});
}

/// All as they were where the step began, at rest and moved on by this velocity [m/s].
void put_back(std::span<WorldBody* const> bodies, const IslandBegin& begin, const Eigen::Vector3d& velocity) {
  add_motion(bodies, 0, {}, Eigen::Vector3d::Zero());
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    WorldBody& own = *bodies[i];
    const BodyBegin& from = begin.bodies[i];
    const Eigen::Vector3d way = own.scene().time_step * velocity;
    if (own.full) {
      own.full->step().put(from.q, from.elastic_energy, way);
    } else {
      FrameMotion motion = from.motion;
      motion.position += way;
      motion.linear_velocity.setZero();
      motion.angular_velocity.setZero();
      own.state.q = own.near().q = from.q;
      own.state.elastic_energy = from.elastic_energy;
      own.model.frame->set_motion(motion, own.state.q, own.state.v, own.workspace.frame, own.state.frame);
    }
    own.placement = own.model.frame->placement(own.state.frame);
  }
}

/// Without turning, by which their energy could change.
void go_on_together(std::span<WorldBody* const> bodies, const IslandBegin& begin, double mass) {
  put_back(bodies, begin, begin.momenta.total.linear / mass);
  const Together together(bodies);
  add_motion(bodies, 1, together.motion_of(begin.momenta), together.centre);
}

}  // namespace

void begin_of(std::span<WorldBody* const> bodies, IslandBegin& begin) {
  begin.momenta = {position_of(*bodies.front()), {}};
  begin.bodies.resize(bodies.size());
  begin.is_alone = true;
  FrameMomenta& sum = begin.momenta.total;
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    const WorldBody* const own = bodies[i];
    const BodyFrame& frame = *own->model.frame;
    const std::optional<FrameMomenta> momenta =
        own->full ? own->full->expected_momenta() : frame.expected_momenta(own->workspace.frame);
    const ContactWorkspace& obstacles = own->near().contact;
    const bool touches = own->state.contacts.count > 0 || (obstacles.candidate_count > 0 && obstacles.loaded_count > 0);
    begin.bodies[i].motion = frame.motion(own->state.frame);
    begin.bodies[i].q = own->state.full ? own->state.full->q : own->state.q;
    begin.bodies[i].elastic_energy = own->state.full ? own->state.full->elastic_energy : own->state.elastic_energy;
    begin.is_alone &= momenta && !touches && !holds_modes(own->state.attachments);
    if (!begin.is_alone) continue;
    // The centre of mass goes along its momentum: where the step begins and where it ends give the same.
    sum.linear += momenta->linear;
    sum.angular += momenta->angular + (position_of(*own) - begin.momenta.about).cross(momenta->linear);
  }
}

void go_back(std::span<WorldBody* const> bodies, const IslandBegin& begin) {
  put_back(bodies, begin, Eigen::Vector3d::Zero());
}

bool take_momenta(std::span<WorldBody* const> bodies, const IslandBegin& begin, double allowed) {
  const IslandMomenta& momenta = begin.momenta;
  const Together together(bodies);
  const double least = together.energy_of(momenta);
  if (least > allowed) {
    go_on_together(bodies, begin, together.mass);
    return true;
  }
  const IslandMomenta now = momenta_of(bodies, momenta.about);
  const IslandMomenta missing{momenta.about,
                              {momenta.total.linear - now.total.linear, momenta.total.angular - now.total.angular}};
  add_motion(bodies, 1, together.motion_of(missing), together.centre);
  double kinetic = 0;
  for (const WorldBody* const own : bodies) kinetic += own->kinetic_energy();
  if (kinetic <= allowed) return false;
  const FrameVelocity rigid = together.motion_of(momenta);
  const double share = std::sqrt((allowed - least) / (kinetic - least));
  add_motion(bodies, share, {(1 - share) * rigid.linear, (1 - share) * rigid.angular}, together.centre);
  return false;
}

}  // namespace exmat::runtime
