#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "exmat/exmat.h"

namespace exmat::viewer {

/// Field that the surface is coloured by.
enum class Colouring { kPlain, kDisplacement, kStrainEnergy, kContactForce };

/// Contents of a snapshot beyond the motion.
struct SnapshotRequest {
  Colouring colouring = Colouring::kPlain;
  bool elements = false, targets = false;

  bool operator==(const SnapshotRequest&) const = default;
};

/// One body at one moment.
struct BodySnapshot {
  std::vector<float> q;                      ///< r
  std::array<float, 12> placement{};         ///< rotation and shift, without the body's offset
  std::vector<float> positions;              ///< 3k, world, without the offset [m]; of a body in full space, else empty
  std::vector<float> field;                  ///< k, of strain energy [J/m^3] or contact force [N]; else empty
  std::vector<float> elements;               ///< 3s, world [m]; where asked for
  std::vector<std::vector<double>> weights;  ///< one list for each example force
  std::vector<std::vector<float>> targets;   ///< likewise, r; where asked for
  std::vector<double> bones;                 ///< 12b, transforms of bones, world, without the offset [1], [m]
  std::vector<exmat_contact> contacts;       ///< also with other bodies: of obstacle -1
  exmat_energies energies{};
  exmat_motion motion{};

  Eigen::Vector3d joint(std::size_t bone) const {
    const double* const place = bones.data() + 12 * bone;
    return {place[3], place[7], place[11]};
  }
};

/// A grip or a hand on a joint as it is drawn: in the world, with the body's offset.
struct GripSnapshot {
  int id = 0;
  std::size_t body = 0;
  Eigen::Vector3d point = Eigen::Vector3d::Zero(), target = Eigen::Vector3d::Zero();  ///< [m]
  Eigen::Vector3d force = Eigen::Vector3d::Zero();  ///< on the body [N]; 0 of a hand on a joint
};

struct ObstacleSnapshot {
  std::int64_t id = 0;
  exmat_obstacle obstacle{};
  exmat_motion motion{};
  std::shared_ptr<const std::vector<double>> corners;  ///< 9f, of a mesh or of ground; never null
};

/// Time of steps since the last snapshot.
struct StepTimes {
  std::int64_t steps = 0;  ///< sum over all bodies
  double seconds = 0;      ///< wall clock
  exmat_profile stages{};  ///< sums
  std::int64_t newton_iterations = 0;
  std::uint32_t status = 0;  ///< bits of all of them

  StepTimes& operator+=(const StepTimes& more);
};

/// Share of the work of forces that the basis loses, in [0, 1].
struct LostWork {
  std::optional<double> hand, contact;  ///< the most of any body; none where there is no such force
  bool measured = true;                 ///< false: the mesh is too large to be measured while it moves
};

/// All that is drawn, at one moment.
struct Snapshot {
  std::int64_t steps = 0;
  double time = 0, time_step = 0;  ///< [s]
  double speed = 0;                ///< simulated time over wall clock time, lately
  bool paused = false;
  std::vector<BodySnapshot> bodies;
  std::vector<GripSnapshot> grips;
  std::vector<Eigen::Vector3d> pins;  ///< in the world, with the bodies' offsets [m]
  std::vector<ObstacleSnapshot> obstacles;
  StepTimes times;
  std::string failure;  ///< why the last step was not taken; else empty
};

}  // namespace exmat::viewer
