#include "runtime/sim/model.h"

#include <utility>

namespace exmat::runtime {
namespace {

Complaint missing_group(const char* group) {
  return {"", group, "this part", "none", "precompute the bundle again with this scene (--scene)"};
}

}  // namespace

ModelResult build_model(const ReducedModel& reduced, const ModelOptions& options) {
  if (!reduced.object) return {nullptr, missing_group("/object")};
  if (!reduced.modal) return {nullptr, missing_group("/modal")};
  if (!reduced.cubature) return {nullptr, missing_group("/cubature")};
  const auto material = material_from_name(reduced.object->material);
  if (!material) {
    const std::string found = '"' + reduced.object->material + '"';
    return {nullptr, {"", "/object: attribute material", material_names(), found, "use a newer exmat-runtime"}};
  }
  auto model = std::make_unique<Model>();
  const CubatureData& cubature = *reduced.cubature;
  if (options.polynomial && !reduced.polynomial) return {nullptr, missing_group("/polynomial")};
  std::optional<ReducedPolynomial> polynomial;
  if (options.polynomial) polynomial.emplace(*reduced.polynomial);
  model->internal_force = InternalForce(ReducedElasticity(*material, cubature), std::move(polynomial));
  model->gravity_load = reduced.modal->gravity_load;
  if (options.carried && !(reduced.rigid && reduced.rigid->spin_load.size() > 0))
    return {nullptr, missing_group("/rigid/spin_load")};
  if (options.carried)
    model->carried = CarriedFrame{RigidFrame(*reduced.rigid), reduced.rigid->spin_load};
  else if (reduced.rigid)
    model->rigid.emplace(*reduced.rigid);
  if (reduced.contact)
    model->contact.emplace(*reduced.contact,
                           model->rigid ? reduced.rigid->centre_of_mass : Eigen::Vector3d::Zero().eval());
  if (options.examples && reduced.examples) {
    if (!reduced.projection) return {nullptr, missing_group("/projection")};
    const ExampleSet& set = *reduced.examples;
    ExampleModel& examples = model->examples.emplace();
    examples.weights = ExampleWeights(set.gram, set.h0, set.hq);
    examples.filter = ShapeFilter(*reduced.projection);
    if (options.target_table) {
      if (!reduced.targets) return {nullptr, missing_group("/targets")};
      TargetTableData filtered = *reduced.targets;
      filtered.control_points *= examples.filter.matrix().transpose();
      examples.table.emplace(filtered);
    } else if (auto complaint = examples.target.emplace().build(
                   *material, cubature, set.examples, reduced.projection->target_basis, options.energy_reference)) {
      return {nullptr, std::move(*complaint)};
    }
    if (examples.target) examples.filtered_basis = examples.filter.matrix() * examples.target->basis();
  }
  return {std::move(model), {}};
}

}  // namespace exmat::runtime
