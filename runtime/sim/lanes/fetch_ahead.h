#pragma once

#include <Eigen/Core>

#include "runtime/sim/step/state.h"

namespace exmat::runtime {

/// Asks the caches for what a step takes of a body, so that it is there when the body's turn comes: of thousands of
/// bodies it would not be.
inline void fetch_ahead(const State& state) noexcept {
  constexpr Eigen::Index kCacheLine = 64 / sizeof(double);
  const auto fetch = [](const Eigen::VectorXd& vector) {
    if (vector.size() == 0) return;
    for (Eigen::Index i = 0; i < vector.size(); i += kCacheLine) __builtin_prefetch(vector.data() + i);
    __builtin_prefetch(vector.data() + vector.size() - 1);
  };
  for (const Eigen::VectorXd* vector :
       {&state.q, &state.v, &state.q_previous, &state.v_previous, &state.a, &state.applied_force})
    fetch(*vector);
  for (const ExampleState& examples : state.examples) fetch(examples.weights);
  if (const FreeState* body = std::get_if<FreeState>(&state.frame)) {
    fetch(body->momentum);
    fetch(body->momentum_previous);
  }
}

}  // namespace exmat::runtime
