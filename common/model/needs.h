#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace exmat {

/// What a scene (or an asset's `needs`) asks of a bundle beyond the object, its modes and its cubature.
struct Needs {
  bool examples = true;  ///< /shape_space, /examples, /projection
  bool rigid = true;     ///< /rigid; free bodies only
};

/// One line of the ledger: a bundle group, whether it is in, and why.
struct LedgerEntry {
  std::string group;
  bool included = false;
  std::size_t bytes = 0;  ///< of its datasets
  std::string reason;
};

/// One entry per group of the bundle, in bundle order, bytes 0. Both stages decide by this list alone. method.md,
/// section 7.
std::vector<LedgerEntry> plan_groups(const Needs& needs, bool constrained, bool has_examples);

bool includes(const std::vector<LedgerEntry>& ledger, std::string_view group);

}  // namespace exmat
