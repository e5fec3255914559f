#pragma once

#include <filesystem>
#include <string>

#include "common/model/reduced_model.h"
#include "tests/support/temporary_folder.h"

namespace exmat::test {

/// A model of two tets that fits every rule of the format but no physics. Free: with /rigid and without fixed vertices.
ReducedModel small_model(bool constrained = true, bool with_examples = true);

}  // namespace exmat::test
