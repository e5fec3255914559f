#pragma once

#include "tests/stability/body_run.h"

namespace exmat::precompute {

/// The body that a motion swings through that of a case of Company::kCarried: the same, held at its end.
BodySpec carried_spec(const StabilityCase& test);

/// Steps a case of several bodies, or of one that touches itself, as run_case() does. Checks are of all bodies
/// together: displacements the largest, energies and momenta their sums. `carried` [of carried_spec()] is asked of
/// Company::kCarried. Thread-safe.
StabilityResult run_world_case(const StabilityCase& test, const StudyBody& body, const StudyBody* carried,
                               int most_steps);

}  // namespace exmat::precompute
