#pragma once

#include "runtime/api/handles.h"

namespace exmat::runtime {

/// What is sized by the number of obstacles, and by whether the body meets others, follows them.
void size_for_contact(exmat_body& body);

/// After the body's time was set back or on: obstacles of the host stay where they were at `time_before` [s].
void keep_host_obstacles(double time_before, exmat_body& body) noexcept;

}  // namespace exmat::runtime
