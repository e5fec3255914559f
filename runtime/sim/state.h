#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "runtime/sim/model.h"

namespace exmat::runtime {

/// All that a body carries from step to step. r modes, K examples, d target coordinates.
struct State {
  Eigen::VectorXd q, v;                    ///< [r] reduced displacement, velocity
  Eigen::VectorXd q_previous, v_previous;  ///< [r] one step earlier (BDF2)
  Eigen::VectorXd a;                       ///< [r] acceleration (Newmark)
  std::int64_t step = 0;                   ///< steps taken
  double time = 0;                         ///< step * time_step [s]
  double elastic_energy = 0;               ///< E(q) [J]
  Eigen::VectorXd weights;                 ///< [K] of the last step, after the bias; (1, 0, ...) before the first
  Eigen::VectorXd target;                  ///< [d] y of the last step, see TargetSolver
  bool has_target = false;
};

/// At rest at time 0.
State make_state(const Model& model);

/// At the pose q with the velocity v at time 0.
State make_state(const Model& model, const Eigen::VectorXd& q, const Eigen::VectorXd& v);

}  // namespace exmat::runtime
