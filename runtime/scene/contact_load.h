#pragma once

#include <Eigen/Core>

#include "runtime/sim/step/stepper.h"

namespace exmat::runtime {

/// Adds to `load` [3n] [N], in the body's own frame, what obstacles pressed its vertices by at the end of the last
/// step, which was taken in this workspace.
void add_contact_load(const Model& model, const State& state, const Workspace& workspace, Eigen::VectorXd& load);

}  // namespace exmat::runtime
