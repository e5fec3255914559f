#pragma once

#include "common/bundle/bundle_input.h"

namespace exmat::fuzz {

/// Reads a file in all ways that there are to read a bundle. What these say must agree: a file that validate finds
/// sound is read, and what is read whole can be summarised and read in part.
void check_bundle(const BundleInput& file);

}  // namespace exmat::fuzz
