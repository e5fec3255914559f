#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/model/choices.h"

namespace exmat {

/// Needs of a scene from one region.
struct RegionNeeds {
  std::string name;
  bool targets = true;  ///< its table of targets
  EnergyReference energy_reference = EnergyReference::kExample;
  bool target_space = true;        ///< space that targets are solved for in
  bool target_elasticity = false;  ///< elements for an elastic example force
  bool full_space = true;          ///< what steps in all vertices take of its examples
};

/// Needs of a scene (or an asset's `needs`) from a bundle beyond the object, its modes and its cubature.
struct Needs {
  bool examples = true;                               ///< /shape_space, /examples, /projection
  bool rigid = true;                                  ///< /rigid, of a free body
  bool carried = false;                               ///< /rigid, of a body with fixed vertices that a motion carries
  bool targets = true;                                ///< /targets, of two examples or more
  bool target_space = true;                           ///< /target_space
  bool target_elasticity = false;                     ///< /target_elasticity, of an elastic example force
  bool full_space = true;                             ///< /full_space, of a body that may step in all vertices
  bool fidelity = false;                              ///< /fidelity: of what came of training, of no use to a step
  bool contact = true;                                ///< /contact
  bool render = true;                                 ///< /render, of an asset that names a render mesh
  std::optional<std::vector<RegionNeeds>> regions{};  ///< /regions, those named; absent: all, with tables as `targets`
  ForceMethod internal_force = ForceMethod::kAuto;    ///< any but cubature: /polynomial
  EnergyReference energy_reference = EnergyReference::kExample;  ///< reference of the targets
};

/// One line of the ledger: a bundle group, whether it is in, and why.
struct LedgerEntry {
  std::string group;
  bool included = false;
  std::size_t bytes = 0;  ///< size of its datasets
  std::string reason;
};

/// One entry per group of the bundle, in bundle order, bytes 0, of an asset with so many examples of the whole body,
/// the rest pose among them, so many regions and perhaps a render mesh and a skeleton. Both stages decide by this list
/// alone. docs/overview.md.
std::vector<LedgerEntry> plan_groups(const Needs& needs, bool constrained, std::int64_t example_count,
                                     std::int64_t region_count = 0, bool render_mesh = false, bool skeleton = false);

bool includes(const std::vector<LedgerEntry>& ledger, std::string_view group);

}  // namespace exmat
