#pragma once

#include "runtime/api/handles.h"

namespace exmat::runtime {

/// Refuses points of another model, points for drawing alone, and a body in full space.
exmat_status check_points_in_modes(const char* function, const exmat_body& body, const exmat_points& points) noexcept;

}  // namespace exmat::runtime
