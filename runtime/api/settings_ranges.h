#pragma once

#include "exmat/exmat.h"

namespace exmat::runtime {

/// Throws InvalidArgument where a member is out of the range that schemas/scene.json gives it.
void check_ranges(const exmat_settings& settings);

}  // namespace exmat::runtime
