#pragma once

#include <map>
#include <string>

#include "runtime/api/handles.h"
#include "runtime/api/touches.h"
#include "runtime/sim/world/world.h"

// NOLINTBEGIN(readability-identifier-naming): its name is the API's.

struct exmat_world {
  /// A body of it, at the same place as in `world`.
  struct Member {
    std::int64_t id = 0;
    std::string name;
    exmat_body* body = nullptr;  ///< the world's, unless this is the body's own
    std::int64_t kind = -1;      ///< in the scene
  };
  struct HostedObstacle {
    std::int64_t id = 0;
    std::shared_ptr<exmat::runtime::Obstacle> obstacle;
    bool hosted = false;                         ///< added or moved by the host, not by the scene
    exmat::runtime::RigidMotion scene_motion{};  ///< where it goes until a host moves it
  };

  explicit exmat_world(const exmat_contact_law& its_law);
  ~exmat_world();
  exmat_world(const exmat_world&) = delete;
  exmat_world& operator=(const exmat_world&) = delete;

  exmat_contact_law law;
  bool is_own = false;  ///< true for the world of a single body, which keeps it
  exmat::runtime::World world;
  std::vector<Member> members;  ///< in ascending order of ids
  std::int64_t next_id = 0;
  std::vector<HostedObstacle> obstacles;  ///< in ascending order of ids
  std::int64_t next_obstacle = 0;
  std::int64_t steps = 0;                    ///< its time over the time step
  std::vector<exmat_body_contact> contacts;  ///< at the end of the last step
  exmat::runtime::Touches touches;           ///< in the last call that stepped it
  bool profiled = false;
  exmat::runtime::WorldProfile profile;  ///< profile of the last call that stepped it, where it is profiled
  /// Surfaces of the models whose bodies were ever in it.
  std::map<std::shared_ptr<const exmat::runtime::Source>, std::shared_ptr<const exmat::runtime::TouchingSurface>>
      surfaces;
};

// NOLINTEND(readability-identifier-naming)

namespace exmat::runtime {

ContactLaw contact_law_of(const exmat_contact_law& law) noexcept;

/// The stiffness of contacts. Throws InvalidArgument where it is none, or beyond what schemas/scene.json allows; `name`
/// is for messages.
double contact_stiffness(double number, const char* name);

/// A body's place among the members of its world.
int place_of(const exmat_body& body) noexcept;

/// An obstacle's place among those of its world; -1 where there is none of that number.
std::ptrdiff_t place_of_obstacle(const exmat_world& world, std::int64_t id) noexcept;

/// Scratch that steps of the body are taken in, to be used between steps.
inline Workspace& scratch_of(exmat_body& body) noexcept { return body.world->world.scratch(place_of(body)); }

/// [s]
double time_of(const exmat_world& world) noexcept;

/// At rest where it starts, at its time 0, without applied forces.
void put_to_start(exmat_body& body) noexcept;

/// World position [m] of a point that has rows of the basis.
Eigen::Vector3d world_position(const PointSet& points, Eigen::Index i, const exmat_body& body,
                               const Placement& placement) noexcept;

/// A body was put elsewhere: its world forgets what it touched.
void was_put(exmat_body& body) noexcept;

/// After the time of the body, or of all bodies of the world, was set: that of a body's own world follows, and its
/// obstacles of the host stay where they were; a body in another world takes that one's time.
void follow_time(exmat_body& body, double time_before) noexcept;
void follow_times(exmat_world& world, double time_before) noexcept;

/// Puts a body into a world of its own. Where it throws, nothing has changed.
void join_own(exmat_body& body);

/// Takes a body out of a world that is not its own, without giving it another.
void leave_world(exmat_body& body) noexcept;

/// The body meets those obstacles of its world that its group and mask allow; its contacts with others are forgotten.
void meet_obstacles(exmat_body& body);

/// A world's obstacles from now on: copies of a scene's.
void take_obstacles(const Obstacles& obstacles, exmat_world& world);

/// After that: what these hold of a body of the world goes with the copies.
void hold_by_copies(const Obstacles& obstacles, exmat_body& body);

}  // namespace exmat::runtime
