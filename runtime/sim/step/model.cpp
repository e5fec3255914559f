#include "runtime/sim/step/model.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "common/model/example_pull.h"

namespace exmat::runtime {
namespace {

Complaint missing_group(const std::string& group) {
  return {"", group, "this part", "none", "precompute the bundle again with this scene (--scene)"};
}

/// Data that the energies of targets need beside the examples.
struct RestModel {
  MaterialModel material;
  const CubatureData& cubature;
};

/// The parts of a bundle behind one example force.
struct ExampleParts {
  std::string region;  ///< empty: the whole body
  const ExampleSet& set;
  const ProjectionData& projection;
  const std::optional<TargetTableData>& targets;
  const std::optional<TargetSpaceData>& target_space;
  const std::optional<TargetElasticityData>& target_elasticity;

  std::string group(const char* part) const { return (region.empty() ? "" : "/regions/" + region) + part; }
};

/// The elements of a space of targets, as those of a cubature.
CubatureData cubature_of(const TargetSpaceData& space) {
  CubatureData elements;
  elements.weights = space.weights;
  elements.volumes = space.volumes;
  elements.gradient = space.gradient;
  elements.youngs_modulus = space.youngs_modulus;
  elements.poisson_ratio = space.poisson_ratio;
  return elements;
}

/// A solver in the space of targets; before format 7 in the modal basis.
std::optional<Complaint> add_solver(const RestModel& rest, const ExampleParts& parts, EnergyReference reference,
                                    ExampleModel& examples) {
  TargetSolver& solver = examples.target.emplace();
  if (!parts.target_space) {
    auto complaint =
        solver.build(rest.material, rest.cubature, parts.set.examples, parts.projection.target_basis, reference);
    examples.target_pull = examples.filter * solver.basis();
    return complaint;
  }
  const TargetSpaceData& space = *parts.target_space;
  std::vector<ExampleData> poses = parts.set.examples;
  for (std::size_t k = 0; k < poses.size(); ++k)
    poses[k].pose = space.poses.row(static_cast<Eigen::Index>(k)).transpose();
  const Eigen::Index d = space.poses.cols();
  auto complaint = solver.build(rest.material, cubature_of(space), poses, RowMatrix::Identity(d, d), reference);
  examples.target_pull = space.pull * solver.basis();
  return complaint;
}

/// The elastic energy from the target, in place of its pull.
std::optional<Complaint> add_elasticity(const RestModel& rest, const ExampleParts& parts, ExampleModel& examples) {
  if (!parts.target_elasticity) return missing_group(parts.group("/target_elasticity"));
  const TargetElasticityData& data = *parts.target_elasticity;
  if (examples.table) {
    TargetTableData table = *parts.targets;
    if (data.control_points.rows() != table.control_points.rows())
      return Complaint{"", parts.group("/target_elasticity/control_points"),
                       std::to_string(table.control_points.rows()) + " control points, as the table of targets",
                       std::to_string(data.control_points.rows()), "precompute the bundle again"};
    table.control_points = data.control_points;
    examples.table.emplace(table);
  }
  const Eigen::Index d = data.target_gradient.cols();
  if (examples.target && examples.target->basis().rows() != d) return missing_group(parts.group("/target_space"));
  examples.elasticity.emplace(rest.material, data,
                              examples.table ? RowMatrix(RowMatrix::Identity(d, d)) : examples.target->basis());
  return std::nullopt;
}

std::optional<Complaint> add_examples(const RestModel& rest, const ExampleParts& parts, const RegionOptions& options,
                                      Model& model) {
  ExampleModel examples;
  examples.region = parts.region;
  examples.weights = ExampleWeights(parts.set.gram, parts.set.h0, parts.set.hq);
  const ProjectionData& projection = parts.projection;
  if (const Eigen::Index seen = projection.filter_scale.size();
      seen != 0 && 3 * seen != projection.shape_from_reduced.rows())
    return Complaint{"", parts.group("/projection/filter_scale"), "none, or one for each eigenfunction",
                     std::to_string(seen), "precompute the bundle again"};
  const Eigen::MatrixXd filter = pull_from_shape(projection) * projection.shape_from_reduced;
  examples.filter = 0.5 * (filter + filter.transpose());
  if (options.target_table) {
    if (!parts.targets) return missing_group(parts.group("/targets"));
    TargetTableData pull = *parts.targets;
    if (!pull.is_pull) pull.control_points *= examples.filter.transpose();
    examples.table.emplace(pull);
  } else if (auto complaint = add_solver(rest, parts, options.energy_reference, examples)) {
    complaint->place = parts.group("") + complaint->place;
    return complaint;
  }
  if (options.elastic)
    if (auto complaint = add_elasticity(rest, parts, examples)) return complaint;
  model.examples.push_back(std::move(examples));
  return std::nullopt;
}

}  // namespace

ModelResult build_model(const ReducedModel& reduced, const ModelOptions& options) {
  if (!reduced.object) return {nullptr, missing_group("/object")};
  if (!reduced.modal) return {nullptr, missing_group("/modal")};
  if (!reduced.cubature) return {nullptr, missing_group("/cubature")};
  auto model = std::make_unique<Model>();
  const CubatureData& cubature = *reduced.cubature;
  if (options.polynomial && !reduced.polynomial) return {nullptr, missing_group("/polynomial")};
  std::optional<ReducedPolynomial> polynomial;
  if (options.polynomial) polynomial.emplace(*reduced.polynomial);
  model->internal_force =
      InternalForce(ReducedElasticity(reduced.object->materials.model, cubature), std::move(polynomial));
  model->gravity_load = reduced.modal->gravity_load;
  if (options.carried && !(reduced.rigid && reduced.rigid->spin_load.size() > 0))
    return {nullptr, missing_group("/rigid/spin_load")};
  model->frame = make_frame(reduced.rigid ? &*reduced.rigid : nullptr, options.carried, model->gravity_load);
  if (reduced.skeleton) model->skeleton = std::make_shared<const Skeleton>(*reduced.skeleton);
  if (reduced.contact)
    model->contact.emplace(*reduced.contact, model->frame->origin(),
                           reduced.rigid ? reduced.rigid->mass : std::numeric_limits<double>::infinity());
  const RestModel rest{reduced.object->materials.model, cubature};
  if (options.examples && reduced.examples) {
    if (!reduced.projection) return {nullptr, missing_group("/projection")};
    const ExampleParts parts{
        "", *reduced.examples, *reduced.projection, reduced.targets, reduced.target_space, reduced.target_elasticity};
    const RegionOptions whole{"", options.target_table, options.elastic, options.energy_reference};
    if (auto complaint = add_examples(rest, parts, whole, *model)) return {nullptr, std::move(*complaint)};
  }
  for (const RegionOptions& region : options.regions) {
    const auto found = std::ranges::find(reduced.regions, region.region, &RegionData::name);
    if (found == reduced.regions.end()) return {nullptr, missing_group("/regions/" + region.region)};
    const ExampleParts parts{found->name,    found->examples,     found->projection,
                             found->targets, found->target_space, found->target_elasticity};
    if (auto complaint = add_examples(rest, parts, region, *model)) return {nullptr, std::move(*complaint)};
  }
  return {std::move(model), {}};
}

}  // namespace exmat::runtime
