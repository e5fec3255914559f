#pragma once

#include <algorithm>
#include <vector>

#include "tests/runtime/sim/world/touching_blocks.h"

namespace exmat::runtime::test {

/// A bar with two prongs, 0.08 m apart.
inline exmat::test::BarOptions fork(bool free, int linear_modes = 12) {
  return {.cells = {8, 2, 3},
          .lengths = {0.64, 0.16, 0.24},
          .youngs_modulus = 1e5,
          .free = free,
          .slot_start = 2,
          .linear_modes = linear_modes};
}

/// A fork in a world of its own.
struct Fork {
  Fork(double time_step, bool free, bool meets_itself, int linear_modes = 12)
      : blocks(time_step, fork(free, linear_modes), meets_itself) {
    const VertexArray& rest = blocks.bar.model.object->mesh.vertices;
    const double length = rest.col(0).maxCoeff();
    for (Eigen::Index v = 0; v < rest.rows(); ++v) {
      if (rest(v, 0) < length - 1e-9) continue;
      if (std::abs(rest(v, 2) - 0.08) < 1e-9) below.push_back(v);
      if (std::abs(rest(v, 2) - 0.16) < 1e-9) above.push_back(v);
    }
    // The one of the lowest modes that brings the ends of the prongs together most.
    Eigen::Index best = 0;
    for (Eigen::Index j = 0; j < std::min<Eigen::Index>(12, blocks.model->modes()); ++j)
      if (std::abs(closing(j)) > std::abs(closing(best))) best = j;
    mode = best;
  }

  double closing(Eigen::Index j) const {
    return blocks.bar.basis()(3 * below.front() + 2, j) - blocks.bar.basis()(3 * above.front() + 2, j);
  }
  /// Displacement of a vertex, of a fork that is clamped [m].
  Eigen::Vector3d displacement(const State& state, Eigen::Index vertex) const {
    if (state.full) return full_displacement(*blocks.full, Placement(), *state.full, vertex);
    return blocks.bar.basis().middleRows<3>(3 * vertex) * state.q;
  }
  /// Gap between the ends of its prongs, negative where they overlap [m].
  double gap(const State& state) const {
    return 0.08 + displacement(state, above.front()).z() - displacement(state, below.front()).z();
  }
  /// At a gap [m] that closes at a speed [m/s].
  WorldBodyStart closed_to(double gap, double speed, const Eigen::Vector3d& spin = Eigen::Vector3d::Zero(),
                           bool in_full_space = false) const {
    const Eigen::VectorXd closed = Eigen::VectorXd::Unit(blocks.model->modes(), mode) / closing(mode);
    State state = make_state(*blocks.model, (0.08 - gap) * closed, speed * closed);
    set_motion(*blocks.model, {.angular_velocity = spin}, state);
    WorldBodyStart start{{blocks.model.get(), &blocks.scene, blocks.surface}, std::move(state)};
    if (in_full_space) blocks.put_in_full_space(start);
    return start;
  }

  FullBlocks blocks;
  std::vector<Eigen::Index> below, above;
  Eigen::Index mode = 0;
};

}  // namespace exmat::runtime::test
