#pragma once

#include <span>
#include <vector>

#include "runtime/api/handles.h"

namespace exmat::runtime {

/// Count of the numbers that write_state() writes: 7, 6 r, f forces of the caller, in full space 1 + 4 f, the
/// skeleton's, the frame's, K + d + 2 for each example force, 3 of sleep if it may sleep, 10 for each contact.
std::size_t state_size(const exmat_body& body);

/// All that the body carries from step to step; state_size() numbers, after 6 that say of what: the layout, the time
/// step, the steps taken, whether the next one begins anew, the number of contacts, whether it is in full space.
std::vector<double> write_state(const exmat_body& body);

/// Takes what write_state() wrote of a body of the same model; in a world with others the time stays the world's.
/// Throws InvalidArgument, and the body is as it was, where numbers are none, or of another model.
void set_state(std::span<const double> numbers, exmat_body& body);
/// The same with its time, which the caller gives to all bodies of the world.
void take_state(std::span<const double> numbers, exmat_body& body);

}  // namespace exmat::runtime
