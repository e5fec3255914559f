#pragma once

#include <Eigen/Core>
#include <optional>

namespace exmat::precompute {

/// How the centre of mass moves when a body's first contact with obstacles is over.
struct Rebound {
  double time = 0;                                     ///< [s] end of the first step without contact
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  ///< then, world [m/s]
};

/// Finds the rebound among the steps of a run. A contact is over when none has come back for so long: an elastic body
/// that lets go of the ground with one end while the other swings down has not bounced yet.
class ReboundFinder {
 public:
  /// `pause` > 0 [s].
  explicit ReboundFinder(double pause) : pause_(pause) {}

  /// The next step: its end, whether a vertex touched an obstacle, and the velocity of the centre of mass [m/s].
  void add(double time, bool contact, const Eigen::Vector3d& velocity);

  /// Nothing where nothing touched, or where the first contact was not over.
  const std::optional<Rebound>& found() const { return found_; }

 private:
  double pause_;
  bool touched_ = false;
  std::optional<Rebound> candidate_, found_;
};

/// |v - v_reference| / |v_reference|; nothing unless both bounced, infinite where the reference stood still.
std::optional<double> rebound_error(const std::optional<Rebound>& rebound, const std::optional<Rebound>& reference);

}  // namespace exmat::precompute
