#pragma once

#include <cstdint>

#include "common/model/reduced_model.h"
#include "precompute/fem/elastic_system.h"
#include "precompute/targets/mesh_target.h"

namespace exmat::precompute {

struct TargetElementOptions {
  EnergyReference energy_reference = EnergyReference::kExample;
  double tolerance = 1e-3;  ///< error of a target, in the energy norm at rest, relative to the largest example
  std::uint64_t seed = 1;
};

/// Tets and weights that stand for all of `target` in its energies, in its coordinates: chosen so that the force of
/// each example's energy is right near all targets, by greedy selection with swaps (docs/method.md, "Cubature"), as
/// many as the tolerance asks for at weights of their own. heldout_error is the largest distance of a target then.
CubatureData target_elements(const ObjectData& object, const ElasticSystem& system, const PoseCoordinates& coordinates,
                             const MeshTarget& target, const TargetElementOptions& options);

}  // namespace exmat::precompute
