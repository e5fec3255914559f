#pragma once

#include "runtime/api/handles.h"
#include "runtime/api/state_numbers.h"

namespace exmat::runtime {

inline constexpr double kMostSteps = 9007199254740992;  // 2^53: whole numbers up to here have all their digits

/// Writes or counts all that a body carries from step to step: 7 numbers that say of what (layout, time step, steps
/// taken, whether the next one begins anew, whether one has led there, contacts, whether it is in full space), 1 + 6 r,
/// f forces of the caller, in full space 1 + 4 f and the skeleton's, the frame's, K + d + 2 for each example force, 3
/// of sleep if it may sleep, 10 for each contact.
void visit_state(StateWriter& writer, const exmat_body& body);
/// Checks or takes them. What its world knows of the body stays.
void visit_state(StateReader& reader, exmat_body& body);

}  // namespace exmat::runtime
