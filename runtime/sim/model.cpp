#include "runtime/sim/model.h"

#include <utility>

namespace exmat::runtime {
namespace {

Complaint missing_group(const char* group) {
  return {"", group, "this group", "none", "precompute the bundle again with this scene (--scene)"};
}

}  // namespace

ModelResult build_model(const ReducedModel& reduced, const ModelOptions& options) {
  if (!reduced.object) return {nullptr, missing_group("/object")};
  if (!reduced.modal) return {nullptr, missing_group("/modal")};
  if (!reduced.cubature) return {nullptr, missing_group("/cubature")};
  const auto material = material_from_name(reduced.object->material);
  if (!material) {
    const std::string found = '"' + reduced.object->material + '"';
    return {nullptr, {"", "/object: attribute material", "\"stvk\"", found, "use a newer exmat-runtime"}};
  }
  auto model = std::make_unique<Model>();
  const CubatureData& cubature = *reduced.cubature;
  model->elasticity = ReducedElasticity(*material, cubature.gradient, cubature.weights.cwiseProduct(cubature.volumes),
                                        cubature_lame(cubature));
  model->gravity_load = reduced.modal->gravity_load;
  if (options.examples && reduced.examples) {
    if (!reduced.projection) return {nullptr, missing_group("/projection")};
    const ExampleSet& set = *reduced.examples;
    ExampleModel& examples = model->examples.emplace();
    examples.weights = ExampleWeights(set.gram, set.h0, set.hq);
    examples.filter = ShapeFilter(*reduced.projection);
    if (auto complaint = examples.target.build(*material, cubature, set.examples, reduced.projection->target_basis,
                                               options.energy_reference))
      return {nullptr, std::move(*complaint)};
  }
  return {std::move(model), {}};
}

}  // namespace exmat::runtime
