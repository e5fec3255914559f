#include "common/model/needs.h"

#include <algorithm>

namespace exmat {
namespace {

LedgerEntry plan_targets(const Needs& needs, const LedgerEntry& examples, std::int64_t example_count) {
  if (!examples.included) return {"targets", false, 0, examples.reason};
  if (!needs.targets) return {"targets", false, 0, "no table of targets is asked for"};
  if (example_count < 2) return {"targets", false, 0, "the rest pose is the only example"};
  return {"targets", true, 0, "an example force is asked for"};
}

LedgerEntry plan_target_space(const Needs& needs, const LedgerEntry& examples) {
  if (!examples.included) return {"target_space", false, 0, examples.reason};
  if (!needs.target_space) return {"target_space", false, 0, "no targets are solved for"};
  return {"target_space", true, 0, "targets may be solved for"};
}

LedgerEntry plan_target_elasticity(const Needs& needs, const LedgerEntry& examples) {
  if (!examples.included) return {"target_elasticity", false, 0, examples.reason};
  if (!needs.target_elasticity) return {"target_elasticity", false, 0, "no elastic example force is asked for"};
  return {"target_elasticity", true, 0, "an elastic example force is asked for"};
}

LedgerEntry plan_full_space(const Needs& needs, const LedgerEntry& examples, bool skeleton) {
  if (!needs.full_space && !skeleton) return {"full_space", false, 0, "no steps in full space are asked for"};
  if (!examples.included) return {"full_space", false, 0, examples.reason + "; the mesh is enough"};
  return {"full_space", true, 0,
          skeleton ? "a body on bones steps in full space" : "steps in full space are asked for"};
}

LedgerEntry plan_polynomial(const Needs& needs) {
  if (needs.internal_force == ForceMethod::kCubature)
    return {"polynomial", false, 0, "the internal force is by cubature"};
  if (needs.internal_force == ForceMethod::kPolynomial)
    return {"polynomial", true, 0, "the internal force is a polynomial"};
  return {"polynomial", true, 0, "the internal force may be a polynomial"};
}

LedgerEntry plan_regions(const Needs& needs, std::int64_t region_count) {
  if (region_count == 0) return {"regions", false, 0, "the asset has no regions"};
  if (needs.regions && needs.regions->empty()) return {"regions", false, 0, "no local example force is asked for"};
  return {"regions", true, 0, "local example forces are asked for"};
}

LedgerEntry plan_render(const Needs& needs, bool render_mesh) {
  if (!render_mesh) return {"render", false, 0, "the asset has no render mesh"};
  if (!needs.render) return {"render", false, 0, "the render mesh is not asked for"};
  return {"render", true, 0, "the render mesh is asked for"};
}

}  // namespace

std::vector<LedgerEntry> plan_groups(const Needs& needs, bool constrained, std::int64_t example_count,
                                     std::int64_t region_count, bool render_mesh, bool skeleton) {
  const std::string example_reason = example_count == 0 && region_count > 0 ? "every example is of a region"
                                     : example_count == 0                   ? "the asset has no examples"
                                     : !needs.examples                      ? "no example force is asked for"
                                                                            : "an example force is asked for";
  const LedgerEntry examples = {"examples", needs.examples && example_count > 0, 0, example_reason};
  const LedgerEntry regions = plan_regions(needs, region_count);
  const bool rigid = constrained ? needs.carried : needs.rigid;
  const std::string rigid_reason = constrained ? (rigid ? "a motion carries the body" : "the body is constrained")
                                               : (rigid ? "the body is free" : "no rigid motion is asked for");
  return {
      {"object", true, 0, "always"},
      {"shape_space", examples.included || regions.included, 0, examples.included ? example_reason : regions.reason},
      examples,
      {"modal", true, 0, "always"},
      {"cubature", true, 0, "always"},
      plan_polynomial(needs),
      {"projection", examples.included, 0, example_reason},
      plan_targets(needs, examples, example_count),
      plan_target_space(needs, examples),
      plan_target_elasticity(needs, examples),
      plan_full_space(needs, examples, skeleton),
      {"fidelity", needs.fidelity, 0, needs.fidelity ? "runs in full space to compare with" : "nothing was trained on"},
      regions,
      {"rigid", rigid, 0, rigid_reason},
      {"contact", needs.contact, 0, needs.contact ? "contact is asked for" : "no contact is asked for"},
      plan_render(needs, render_mesh),
      {"skeleton", skeleton, 0, skeleton ? "the body hangs on bones" : "the object has no bones"}};
}

bool includes(const std::vector<LedgerEntry>& ledger, std::string_view group) {
  return std::any_of(ledger.begin(), ledger.end(),
                     [group](const LedgerEntry& entry) { return entry.included && entry.group == group; });
}

}  // namespace exmat
