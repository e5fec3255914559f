#include "runtime/scene/state_hash.h"

namespace exmat::runtime {

void add_to_hash(const Model& model, const State& state, FnvHash& hash) {
  hash.add_all(state.q);
  hash.add_all(state.v);
  if (state.full) {
    hash.add_all(state.full->q);
    hash.add_all(state.full->v);
  }
  hash.add_all(model.frame->coordinates(state.frame));
}

}  // namespace exmat::runtime
