#pragma once

#include <Eigen/Core>
#include <optional>

namespace exmat::precompute {

/// Motion of the centre of mass after a contact with obstacles.
struct Rebound {
  double time = 0;                                     ///< [s] end of the first step without contact
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  ///< then, world [m/s]
};

/// Finds the rebound among the steps of a run: that of the contact which changes the velocity of the centre of mass the
/// most, a crash before a touch of the floor on the way there. A contact is over when none has come back for so long:
/// an elastic body that lets go of the ground with one end while the other swings down has not bounced yet.
class ReboundFinder {
 public:
  /// `pause` > 0 [s].
  explicit ReboundFinder(double pause) : pause_(pause) {}

  /// The start, then each step: its end, whether a vertex touched an obstacle, and the velocity of the centre of mass
  /// [m/s].
  void add(double time, bool contact, const Eigen::Vector3d& velocity);

  /// Nothing where nothing touched, or where the strongest contact so far is not over.
  std::optional<Rebound> found() const;

 private:
  double pause_;
  bool open_ = false;                                 // a contact, or the pause after it
  Eigen::Vector3d before_ = Eigen::Vector3d::Zero();  // of the open contact
  Eigen::Vector3d former_ = Eigen::Vector3d::Zero();  // at the last step
  std::optional<Rebound> candidate_, strongest_;
  double strongest_change_ = 0;
};

/// |v - v_reference| / |v_reference|; nothing unless both bounced, infinite where the reference stood still.
std::optional<double> rebound_error(const std::optional<Rebound>& rebound, const std::optional<Rebound>& reference);

}  // namespace exmat::precompute
