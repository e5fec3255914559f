#include "precompute/study/measure/rebound.h"

#include <limits>

namespace exmat::precompute {

void ReboundFinder::add(double time, bool contact, const Eigen::Vector3d& velocity) {
  if (contact) {
    if (!open_) before_ = former_;
    open_ = true;
    candidate_.reset();
  } else if (open_) {
    if (!candidate_) candidate_ = Rebound{time, velocity};
    if (time - candidate_->time >= pause_) {
      const double change = (candidate_->velocity - before_).norm();
      if (!strongest_ || change > strongest_change_) {
        strongest_ = candidate_;
        strongest_change_ = change;
      }
      open_ = false;
      candidate_.reset();
    }
  }
  former_ = velocity;
}

std::optional<Rebound> ReboundFinder::found() const {
  const bool stronger = open_ && (former_ - before_).norm() > strongest_change_;
  return stronger ? std::nullopt : strongest_;
}

std::optional<double> rebound_error(const std::optional<Rebound>& rebound, const std::optional<Rebound>& reference) {
  if (!rebound || !reference) return std::nullopt;
  const double difference = (rebound->velocity - reference->velocity).norm(), size = reference->velocity.norm();
  if (size > 0) return difference / size;
  return difference > 0 ? std::numeric_limits<double>::infinity() : 0;
}

}  // namespace exmat::precompute
