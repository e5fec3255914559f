#include "precompute/pipeline/modal_training.h"

#include <algorithm>

#include "common/mesh/elements.h"
#include "common/mesh/geometry.h"
#include "precompute/contact/contact_vertices.h"
#include "precompute/cubature/cubature.h"
#include "precompute/fem/rigid_moments.h"
#include "precompute/modes/basis.h"
#include "precompute/pipeline/target_elasticity_stage.h"
#include "precompute/training/reduced_runs.h"

namespace exmat::precompute {
namespace {

constexpr Eigen::Index kMostDisplacements = 50'000;
constexpr Eigen::Index kModes = 100;
constexpr Eigen::Index kElements = 300;
constexpr double kMostDisplacement = 0.3;      // of L, under a load
constexpr int kPoses = 40;                     // that the elements are fitted to
constexpr std::int64_t kEntries = 10'000'000;  // of the matrix that they are chosen by

// [f x k] loads of the segments, one column for gravity and one for each set of forces.
Eigen::MatrixXd loads_of(const std::vector<Chain>& chains, const ElasticSystem& system) {
  std::vector<Eigen::VectorXd> loads;
  for (const Chain& chain : chains)
    for (const Segment& segment : chain) {
      if (segment.gravity.norm() > 0)
        loads.emplace_back(system.full_mass * segment.gravity.replicate(system.full_mass.rows() / 3, 1));
      Eigen::VectorXd forces = Eigen::VectorXd::Zero(system.full_mass.rows());
      for (const VertexForceConfig& force : segment.forces)
        for (const std::int64_t vertex : force.vertices) forces.segment<3>(3 * vertex) += force.force;
      if (forces.norm() > 0) loads.push_back(std::move(forces));
    }
  Eigen::MatrixXd columns(system.mass.rows(), std::ssize(loads));
  for (std::size_t i = 0; i < loads.size(); ++i) columns.col(static_cast<Eigen::Index>(i)) = system.restrict(loads[i]);
  return columns;
}

// Poses of the examples, and the responses.
Eigen::MatrixXd fields_of(const BodyStages& stages, const Eigen::MatrixXd& responses) {
  Eigen::MatrixXd fields(stages.system.mass.rows(), 0);
  if (stages.fitter != nullptr) fields = stages.fitter->fields();
  const Eigen::Index poses = fields.cols();
  fields.conservativeResize(Eigen::NoChange, poses + responses.cols());
  fields.rightCols(responses.cols()) = responses;
  return fields;
}

}  // namespace

bool trains_in_modes(TrainingSpace space, const ElasticSystem& system) {
  return space == TrainingSpace::kModes || (space == TrainingSpace::kAuto && system.mass.rows() > kMostDisplacements);
}

Eigen::MatrixXd static_responses(const ElasticSystem& system, const SemidefiniteSolver& solver, double size,
                                 const std::vector<Chain>& chains) {
  const Eigen::MatrixXd loads = loads_of(chains, system);
  if (loads.cols() == 0) return loads;
  Eigen::MatrixXd responses = solver.solve(loads);
  const double most = kMostDisplacement * size;
  for (auto field : responses.colwise()) {
    const Eigen::VectorXd whole = system.extend(field);
    const double largest = whole.reshaped<Eigen::RowMajor>(whole.size() / 3, 3).rowwise().norm().maxCoeff();
    field *= std::min(1.0, most / largest);
  }
  return responses;
}

ManyModes many_modes(const BodyStages& stages, const ReducedModel& body, const Eigen::MatrixXd& responses, bool thrown,
                     std::uint64_t seed) {
  const ElasticSystem& system = stages.system;
  ManyModes result;
  ReducedModel& model = result.model;
  model.asset_name = body.asset_name;
  model.object = body.object;
  const ObjectData& object = *model.object;
  const double size = bounding_box_diagonal(object.mesh.vertices);
  const BasisInput input{system, stages.modes, stages.derivatives, size, fields_of(stages, responses)};
  const Eigen::Index most = std::min(stages.modes.modes.cols() + stages.derivatives.cols(),
                                     (system.mass.rows() - system.null_space.cols()) / 2);
  const Eigen::MatrixXd basis = modal_basis(input, static_cast<int>(std::min(kModes, most)));
  put_basis(stages, basis, model);
  CubatureOptions options;
  options.elements = static_cast<int>(std::min(kElements, elements_of(object.mesh, object.materials).count()));
  options.training_poses = kPoses;
  options.seed = seed;
  options.measured = false;
  options.training_entries = kEntries;
  const Eigen::MatrixXd poses = basis.transpose() * (system.mass * input.example_fields);
  const PoseSource source = pose_source(system, stages.modes, stages.derivatives, basis, size, poses);
  model.cubature = build_cubature(object.mesh, object.materials, source, options);
  model.cubature->internal_force = ForceMethod::kCubature;
  put_target_elasticity(stages, all_target_elements, model);
  if (!system.constrained()) model.rigid = rigid_moments(object.mesh, object.materials.density, model.modal->basis);
  if (thrown)
    model.contact = contact_data(object, model.modal->basis, stages.object.contact, stages.asset.contact_count);
  result.reference = reference_of(stages);
  return result;
}

TrainingSet run_training(const ManyModes& body, const ElasticSystem& system, const TrainingChains& chains) {
  TrainingRunOptions whole = chains.options;
  whole.positions = true;
  return {reduced_training_runs(body.model, body.reference, chains.runs, system, chains.options),
          reduced_training_runs(body.model, body.reference, chains.heldout, system, whole)};
}

}  // namespace exmat::precompute
