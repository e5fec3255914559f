#include "precompute/training/reduced_runs.h"

#include <utility>

#include "common/core/error.h"
#include "common/core/progress.h"
#include "runtime/sim/step/stepper.h"
#include "runtime/sim/step/workspace.h"

namespace exmat::precompute {
namespace {

using runtime::StepScene;

class ReducedRunner {
 public:
  ReducedRunner(const ReducedModel& data, EnergyReference reference,
                const std::vector<runtime::ExampleSettings>& examples, const TrainingRunOptions& options)
      : data_(data), model_(stepped_model(data, reference, examples)), options_(options) {}

  template <typename Advance>
  ChainFrames run(const Chain& chain, Advance advance) const;

 private:
  StepScene scene_of(const Segment& segment) const;
  Eigen::VectorXd displacement(const Eigen::VectorXd& deformation, const runtime::State& state) const;

  const ReducedModel& data_;
  std::unique_ptr<const runtime::Model> model_;
  const TrainingRunOptions& options_;
};

StepScene ReducedRunner::scene_of(const Segment& segment) const {
  StepScene scene;
  scene.time_step = time_step_of(options_);
  scene.mass_damping = options_.mass_damping.value_or(0);
  scene.stiffness_damping = stiffness_damping_of(options_);
  scene.gravity = segment.gravity;
  scene.gravity_force = runtime::gravity_force(*model_, segment.gravity);
  scene.examples = segment.examples;
  if (segment.obstacle) scene.obstacles.push_back(*segment.obstacle);
  for (const VertexForceConfig& force : segment.forces) {
    RowMatrix rows(3 * force.vertices.size(), model_->modes());
    VertexArray positions(std::ssize(force.vertices), 3);
    for (Eigen::Index i = 0; i < positions.rows(); ++i) {
      const std::int64_t vertex = force.vertices[static_cast<std::size_t>(i)];
      rows.middleRows<3>(3 * i) = data_.modal->basis.middleRows<3>(3 * vertex);
      positions.row(i) = data_.object->mesh.vertices.row(vertex);
    }
    scene.forces.push_back(runtime::scripted_force(*model_, rows, positions, force.force));
  }
  return scene;
}

Eigen::VectorXd ReducedRunner::displacement(const Eigen::VectorXd& deformation, const runtime::State& state) const {
  if (!model_->frame->moves()) return deformation;
  const runtime::Placement placement = model_->frame->placement(state.frame);
  const VertexArray& rest = data_.object->mesh.vertices;
  Eigen::VectorXd moved(deformation.size());
  for (Eigen::Index v = 0; v < rest.rows(); ++v) {
    const Eigen::Vector3d at_rest = rest.row(v).transpose();
    moved.segment<3>(3 * v) = placement.to_world(at_rest + deformation.segment<3>(3 * v)) - at_rest;
  }
  return moved;
}

template <typename Advance>
ChainFrames ReducedRunner::run(const Chain& chain, Advance advance) const {
  ChainFrames run;
  runtime::State state = runtime::make_state(*model_);
  runtime::set_motion(*model_, chain.front().motion, state);
  for (const Segment& segment : chain) {
    const StepScene scene = scene_of(segment);
    runtime::Workspace workspace(*model_, scene);
    runtime::prepare_contacts(*model_, scene.obstacles.size(), state);
    state.begins_anew = true;
    const std::int64_t steps = steps_of(segment, options_);
    for (std::int64_t i = 0; i < steps && run.finite; ++i) {
      run.finite = (runtime::step(*model_, scene, state, workspace).status & runtime::kStepNonFinite) == 0;
      ++run.steps;
      advance();
      if (!run.finite || (i + 1) % kStepsPerSnapshot != 0) continue;
      run.deformations.emplace_back(data_.modal->basis * state.q);
      run.displacements.push_back(displacement(run.deformations.back(), state));
    }
    if (run.finite) ++run.segments;
  }
  return run;
}

}  // namespace

std::unique_ptr<const runtime::Model> stepped_model(const ReducedModel& data, EnergyReference reference,
                                                    const std::vector<runtime::ExampleSettings>& examples) {
  runtime::ModelOptions options;
  options.examples = data.examples.has_value();
  options.target_table = data.targets.has_value();
  options.energy_reference = reference;
  auto own = examples.begin();
  const auto is_elastic = [&] { return own != examples.end() && (own++)->elastic; };
  if (options.examples) options.elastic = is_elastic();
  options.polynomial = data.polynomial && data.cubature->internal_force == ForceMethod::kPolynomial;
  for (const RegionData& region : data.regions)
    options.regions.push_back(
        {region.name, region.targets.has_value(), is_elastic(),
         region.target_space ? region.target_space->energy_reference : EnergyReference::kExample});
  auto [model, complaint] = runtime::build_model(data, options);
  if (!model) throw InputError(complaint);
  return std::move(model);
}

std::vector<ChainFrames> run_reduced_chains(const ReducedModel& model, EnergyReference reference,
                                            const std::vector<Chain>& chains, const TrainingRunOptions& options) {
  std::vector<ChainFrames> runs(chains.size());
  if (chains.empty()) return runs;
  const ReducedRunner runner(model, reference, chains.front().front().examples, options);
  Progress progress("reduced runs", step_count(chains, options));
#pragma omp parallel for schedule(dynamic)
  for (std::size_t i = 0; i < chains.size(); ++i)
    runs[i] = runner.run(chains[i], [&] {
#pragma omp critical(reduced_runs_progress)
      progress.advance();
    });
  return runs;
}

TrainingRuns reduced_training_runs(const ReducedModel& model, EnergyReference reference,
                                   const std::vector<Chain>& chains, const ElasticSystem& system,
                                   const TrainingRunOptions& options) {
  const std::vector<ChainFrames> runs = run_reduced_chains(model, reference, chains, options);
  TrainingRuns all;
  std::int64_t frames = 0;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    all.segments += runs[i].segments;
    all.skipped += std::ssize(chains[i]) - runs[i].segments;
    all.steps += runs[i].steps;
    all.chain_ends.push_back(frames += std::ssize(runs[i].deformations));
  }
  const Eigen::Index rows = model.modal->basis.rows();
  all.snapshots.resize(system.mass.rows(), frames);
  if (options.positions) {
    all.deformations.resize(rows, frames);
    all.displacements.resize(rows, frames);
  }
  Eigen::Index column = 0;
  for (const ChainFrames& run : runs)
    for (std::size_t i = 0; i < run.deformations.size(); ++i, ++column) {
      all.snapshots.col(column) = system.restrict(run.deformations[i]);
      if (!options.positions) continue;
      all.deformations.col(column) = run.deformations[i];
      all.displacements.col(column) = run.displacements[i];
    }
  return all;
}

}  // namespace exmat::precompute
