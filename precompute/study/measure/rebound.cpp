#include "precompute/study/measure/rebound.h"

#include <limits>

namespace exmat::precompute {

void ReboundFinder::add(double time, bool contact, const Eigen::Vector3d& velocity) {
  if (found_) return;
  if (contact) {
    touched_ = true;
    candidate_.reset();
    return;
  }
  if (!touched_) return;
  if (!candidate_) candidate_ = Rebound{time, velocity};
  if (time - candidate_->time >= pause_) found_ = candidate_;
}

std::optional<double> rebound_error(const std::optional<Rebound>& rebound, const std::optional<Rebound>& reference) {
  if (!rebound || !reference) return std::nullopt;
  const double difference = (rebound->velocity - reference->velocity).norm(), size = reference->velocity.norm();
  if (size > 0) return difference / size;
  return difference > 0 ? std::numeric_limits<double>::infinity() : 0;
}

}  // namespace exmat::precompute
