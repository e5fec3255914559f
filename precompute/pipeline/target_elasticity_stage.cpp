#include "precompute/pipeline/target_elasticity_stage.h"

#include <fmt/format.h>

#include "common/core/log.h"

namespace exmat::precompute {

void put_target_elasticity(const BodyStages& stages, const TargetElementChoice& choose, ReducedModel& model) {
  const ObjectData& object = *model.object;
  auto region = model.regions.begin();
  for (std::size_t i = 0; i < stages.targets.size(); ++i) {
    const auto group = static_cast<Eigen::Index>(i);
    const bool whole = stages.fitter->region(group).empty();
    std::optional<TargetElasticityData>& data = whole ? model.target_elasticity : (region++)->target_elasticity;
    if (!stages.elastic[i]) continue;
    const TargetSpace& targets = stages.targets[i];
    const Eigen::MatrixXd& fields = targets.coordinates.basis;
    const Eigen::MatrixXd basis = stages.system.restrict(model.modal->basis);
    data = choose({object.mesh, object.materials, model.modal->basis, stages.system.extend(fields),
                   stages.fitter->tet_shares(group), targets, basis.transpose() * (stages.system.mass * fields)});
  }
}

TargetElasticityData choose_target_elements(const TargetElasticityInput& input, const PoseSource& source,
                                            const CubatureOptions& options, const CubatureData& cubature,
                                            StageCache& cache, std::vector<std::string>& warnings) {
  TargetElasticityData data = cache.get(
      "target elasticity", [&] { return target_elasticity(input, source, options); }, input.mesh, input.materials,
      input.basis, input.displacements, input.shares, input.targets, source, options);
  const double other = target_elasticity_error(input, source, options, cubature.elements, cubature.weights);
  log::info(
      fmt::format("elastic example force: {} elements, held-out error {:.2f} %; by those of the internal force "
                  "{:.2f} %",
                  data.elements.size(), 100 * data.heldout_error, 100 * other));
  if (options.tolerance && data.heldout_error > *options.tolerance)
    warn(warnings, fmt::format("elastic example force: {} elements have a held-out error of {:.3g}, above "
                               "cubature.tolerance {:.3g}",
                               data.elements.size(), data.heldout_error, *options.tolerance));
  return data;
}

}  // namespace exmat::precompute
