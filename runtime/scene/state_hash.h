#pragma once

#include "common/core/fnv_hash.h"
#include "runtime/sim/step/model.h"
#include "runtime/sim/step/state.h"

namespace exmat::runtime {

/// Adds the bits of q and v of a body, of a free one also where it is and its momenta.
void add_to_hash(const Model& model, const State& state, FnvHash& hash);

}  // namespace exmat::runtime
