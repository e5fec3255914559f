#include "common/model/needs.h"

#include <algorithm>

namespace exmat {

std::vector<LedgerEntry> plan_groups(const Needs& needs, bool constrained, bool has_examples) {
  const bool examples = needs.examples && has_examples;
  const std::string example_reason = !has_examples     ? "the asset has no examples"
                                     : !needs.examples ? "no example force is asked for"
                                                       : "an example force is asked for";
  const std::string rigid_reason = constrained    ? "the body is constrained"
                                   : !needs.rigid ? "no rigid motion is asked for"
                                                  : "the body is free";
  return {{"object", true, 0, "always"},
          {"shape_space", examples, 0, example_reason},
          {"examples", examples, 0, example_reason},
          {"modal", true, 0, "always"},
          {"cubature", true, 0, "always"},
          {"projection", examples, 0, example_reason},
          {"rigid", needs.rigid && !constrained, 0, rigid_reason}};
}

bool includes(const std::vector<LedgerEntry>& ledger, std::string_view group) {
  return std::any_of(ledger.begin(), ledger.end(),
                     [group](const LedgerEntry& entry) { return entry.included && entry.group == group; });
}

}  // namespace exmat
