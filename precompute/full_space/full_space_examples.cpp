#include "precompute/full_space/full_space_examples.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "common/core/error.h"
#include "common/mesh/geometry.h"
#include "precompute/modes/field_clamp.h"
#include "precompute/shape_space/pose_map.h"
#include "precompute/shape_space/projection.h"
#include "precompute/shape_space/region_poses.h"
#include "precompute/shape_space/region_window.h"
#include "precompute/solvers/semidefinite_solver.h"

namespace exmat::precompute {
namespace {

using Field = Eigen::Map<const VertexArray>;

// Squared angular frequency of the highest linear mode, as the pipeline's clamp has it.
double clamp_decay(const ReducedModel& model) {
  const double angular = 2 * std::numbers::pi * model.modal->frequencies.tail(1)[0];
  return angular * angular;
}

Eigen::VectorXd flat(const RowMatrix& matrix) { return matrix.reshaped<Eigen::RowMajor>(); }

void require_examples(const ReducedModel& model, bool there, const std::string& group) {
  if (!there || !model.shape_space || !model.modal)
    throw InputError({"", group, "this group, /shape_space and /modal", "none",
                      "precompute the bundle again with a scene that has these examples"});
}

// The modal basis of a free body holds no rigid motions.
void drop_rigid_motions(const ElasticSystem& system, Eigen::MatrixXd& fields) {
  fields -= system.null_space * (system.null_space.transpose() * (system.mass * fields)).eval();
}

FlagVector flags(const IndexVector& vertices, Eigen::Index count) {
  FlagVector flags = FlagVector::Zero(count);
  flags(vertices).setOnes();
  return flags;
}

}  // namespace

ExamplePoses whole_body_example_poses(const ReducedModel& model, const ElasticSystem& system) {
  require_examples(model, model.examples.has_value(), "/examples");
  const LaplaceBasis object = laplace_basis_of(model);
  const FieldClamp clamp(system, clamp_decay(model), model.asset_name);
  const Eigen::VectorXd weights = descriptor_weights(object, model.shape_space->weighting);
  ExamplePoses result{&*model.examples, {}, whole_body_poses(object, weights, model.object->fixed, clamp)};
  drop_rigid_motions(system, result.fields);
  return result;
}

std::vector<ExamplePoses> region_example_poses(const ReducedModel& model, const ElasticSystem& system,
                                               const std::vector<std::string>& regions) {
  std::vector<ExamplePoses> result;
  if (regions.empty()) return result;
  require_examples(model, !model.regions.empty(), "/regions");
  const ObjectData& body = *model.object;
  const LaplaceBasis object = laplace_basis_of(model);
  const Eigen::VectorXd weights = descriptor_weights(object, model.shape_space->weighting);
  const SemidefiniteSolver solver(system.stiffness, system.mass * system.null_space,
                                  model.asset_name + ": elastic stiffness", system.rigid);
  for (const std::string& name : regions) {
    const auto region = std::ranges::find(model.regions, name, &RegionData::name);
    require_examples(model, region != model.regions.end(), "/regions/" + name);
    ExamplePoses& poses = result.emplace_back();
    poses.examples = &region->examples;
    poses.view.emplace(body.mesh, flags(region->vertices, body.mesh.vertex_count()), body.fixed);
    const RegionPoses map(object, weights, *poses.view, system, solver, kRegionStiffness * clamp_decay(model));
    poses.fields = map.displacements(Eigen::MatrixXd::Identity(3 * weights.size(), 3 * weights.size()));
    drop_rigid_motions(system, poses.fields);
  }
  return result;
}

ExamplePoses known_example_poses(const ReducedModel& model, const std::string& region, PoseCoordinates coordinates) {
  if (region.empty()) return {&*model.examples, {}, {}, std::move(coordinates)};
  const ObjectData& body = *model.object;
  const auto found = std::ranges::find(model.regions, region, &RegionData::name);
  const FlagVector inside = flags(found->vertices, body.mesh.vertex_count());
  return {&found->examples, RegionView(body.mesh, inside, body.fixed), {}, std::move(coordinates)};
}

FullSpaceExamples::FullSpaceExamples(const ReducedModel& model, const ElasticSystem& system, const ExamplePoses& poses,
                                     EnergyReference reference)
    : view_(poses.view), free_dofs_(system.free_dofs), vertices_(model.object->mesh.vertex_count()) {
  if (view_) tet_shares_ = region_tet_shares(model.object->mesh, view_->inside(), view_->window());
  set_filter(model, *poses.examples);
  set_target(model, system, poses, reference);
}

void FullSpaceExamples::set_filter(const ReducedModel& model, const ExampleSet& set) {
  const LaplaceBasis object = laplace_basis_of(model);
  filter_ = FilterFunctions(object, model.object->mesh, model.object->materials.density);
  if (!view_) {
    std::vector<std::int32_t> free_vertices;
    for (std::size_t i = 0; i < free_dofs_.size(); i += 3) free_vertices.push_back(free_dofs_[i] / 3);
    filter_.analysis = RowMatrix(filter_.analysis(free_vertices, Eigen::all));
  }
  const RowMatrix slopes = weight_slopes(object, model.shape_space->weighting, set);
  weights_ = runtime::ExampleWeights(set.gram, set.h0, slopes);
}

void FullSpaceExamples::set_target(const ReducedModel& model, const ElasticSystem& system, const ExamplePoses& poses,
                                   EnergyReference reference) {
  coordinates_ = poses.coordinates
                     ? *poses.coordinates
                     : pose_range(system.mass, poses.fields,
                                  descriptor_changes(model.shape_space->rest_descriptor, *poses.examples));
  MeshTarget target = mesh_target(*model.object, system, coordinates_, reference);
  left_out_ = target.left_out;
  target_ = std::move(target.solver);
  target_fields_ = coordinates_.basis * target_.basis();
}

// [m x 3] functions^T times what is seen of u.
Eigen::MatrixXd FullSpaceExamples::coefficients(const RowMatrix& functions, const Eigen::VectorXd& u) const {
  if (!view_) return functions.transpose() * Field(u.data(), functions.rows(), 3);
  Eigen::VectorXd all = Eigen::VectorXd::Zero(3 * functions.rows());
  all(free_dofs_) = u;
  const Eigen::VectorXd seen = view_->see(all);
  return functions.transpose() * Field(seen.data(), functions.rows(), 3);
}

// Its transpose.
Eigen::VectorXd FullSpaceExamples::force(const RowMatrix& functions, const Eigen::MatrixXd& coefficients) const {
  const Eigen::VectorXd forces = flat(functions * coefficients);
  if (!view_) return forces;
  const Eigen::VectorXd felt = view_->transposed(forces);
  return felt(free_dofs_);
}

Eigen::VectorXd FullSpaceExamples::weights(const Eigen::VectorXd& u) const {
  runtime::ExampleWeights::Workspace workspace = weights_.make_workspace();
  Eigen::VectorXd weights(count());
  weights_.solve(flat(coefficients(filter_.analysis, u)), workspace, weights);
  return weights;
}

Eigen::VectorXd FullSpaceExamples::filter(const Eigen::VectorXd& u) const {
  return std::pow(filter_.root_over_analysis, 2) * force(filter_.analysis, coefficients(filter_.analysis, u));
}

FullSpaceExamples::Root FullSpaceExamples::root() const {
  Root root{RowMatrix::Zero(vertices_, filter_.analysis.cols()), {}};
  if (view_) root.band = view_->band();
  for (std::size_t i = 0; i < free_dofs_.size(); i += 3) {
    const Eigen::Index vertex = free_dofs_[i] / 3, row = view_ ? vertex : static_cast<Eigen::Index>(i / 3);
    const double window = view_ ? view_->window()[vertex] : 1;
    root.filter.row(vertex) = window * filter_.root_over_analysis * filter_.analysis.row(row);
  }
  return root;
}

Eigen::VectorXd FullSpaceExamples::root_coefficients(const Eigen::VectorXd& u) const {
  return filter_.root_over_analysis * flat(coefficients(filter_.analysis, u));
}

}  // namespace exmat::precompute
