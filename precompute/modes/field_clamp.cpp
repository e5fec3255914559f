#include "precompute/modes/field_clamp.h"

namespace exmat::precompute {

FieldClamp::FieldClamp(const ElasticSystem& system, double decay, const std::string& name) : system_(system) {
  if (!system.constrained()) return;
  full_ = system.full_stiffness + decay * system.full_mass;
  solver_.emplace(system.stiffness + decay * system.mass, system.null_space, name + ": clamp of the examples",
                  system.rigid);
}

Eigen::MatrixXd FieldClamp::apply(const Eigen::MatrixXd& fields) const {
  const Eigen::MatrixXd free = system_.restrict(fields);
  if (!solver_) return free;
  const Eigen::MatrixXd moved = fields - system_.extend(free);
  return free + solver_->solve(system_.restrict(full_ * moved));
}

}  // namespace exmat::precompute
