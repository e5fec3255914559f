#include "precompute/training/roll_out.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <utility>

#include "common/core/error.h"
#include "runtime/sim/step/stepper.h"
#include "runtime/sim/step/workspace.h"

namespace exmat::precompute {
namespace {

using runtime::StepScene;

// The forces of all segments are elastic, or none's.
std::unique_ptr<const runtime::Model> prepare(const ReducedModel& data, EnergyReference reference,
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

// Frames of one chain.
struct ReducedFrames {
  std::vector<Eigen::VectorXd> deformations, displacements;  // 3n
  bool finite = true;
};

class ReducedRunner {
 public:
  ReducedRunner(const ReducedModel& data, EnergyReference reference,
                const std::vector<runtime::ExampleSettings>& examples, const TrainingRunOptions& options)
      : data_(data), model_(prepare(data, reference, examples)), options_(options) {}

  ReducedFrames run(const Chain& chain) const;

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

ReducedFrames ReducedRunner::run(const Chain& chain) const {
  ReducedFrames frames;
  runtime::State state = runtime::make_state(*model_);
  runtime::set_motion(*model_, chain.front().motion, state);
  for (const Segment& segment : chain) {
    const StepScene scene = scene_of(segment);
    runtime::Workspace workspace(*model_, scene);
    runtime::prepare_contacts(*model_, scene.obstacles.size(), state);
    state.begins_anew = true;
    const std::int64_t steps = steps_of(segment, options_);
    for (std::int64_t i = 0; i < steps && frames.finite; ++i) {
      frames.finite = (runtime::step(*model_, scene, state, workspace).status & runtime::kStepNonFinite) == 0;
      if (!frames.finite || (i + 1) % kStepsPerSnapshot != 0) continue;
      frames.deformations.emplace_back(data_.modal->basis * state.q);
      frames.displacements.push_back(displacement(frames.deformations.back(), state));
    }
  }
  return frames;
}

// Sums of squares of distances, and of sizes.
struct Sums {
  double distance = 0, size = 0;
  std::int64_t frames = 0;

  void add(double squared_distance, double squared_size) {
    distance += squared_distance;
    size += squared_size;
    ++frames;
  }
};

double square(const SparseMatrix& mass, const Eigen::VectorXd& u) { return u.dot(mass * u); }

// Root mean square of the distances over that of the sizes of all frames.
double relative(const Sums& part, const Sums& all) {
  if (part.frames == 0 || all.size == 0) return 0;
  return std::sqrt(part.distance / static_cast<double>(part.frames) / (all.size / static_cast<double>(all.frames)));
}

void note_worst(const Eigen::VectorXd& difference, RollOut& result) {
  for (Eigen::Index v = 0; v < difference.size() / 3; ++v) {
    const double distance = difference.segment<3>(3 * v).norm();
    if (distance <= result.worst_distance) continue;
    result.worst_distance = distance;
    result.worst_vertex = v;
  }
}

RollOut not_finite() {
  constexpr double kInfinite = std::numeric_limits<double>::infinity();
  return {kInfinite, kInfinite, kInfinite, kInfinite, 0, kInfinite};
}

}  // namespace

RollOut roll_out(const ReducedModel& model, EnergyReference reference, const std::vector<Chain>& chains,
                 const TrainingRuns& full, const SparseMatrix& mass, const TrainingRunOptions& options) {
  std::vector<ReducedFrames> runs(chains.size());
  if (chains.empty()) return {};
  const ReducedRunner runner(model, reference, chains.front().front().examples, options);
#pragma omp parallel for schedule(dynamic)
  for (std::size_t i = 0; i < chains.size(); ++i) runs[i] = runner.run(chains[i]);

  RollOut result;
  Sums positions, shapes, ends, settled;
  Eigen::Index begin = 0;
  for (std::size_t i = 0; i < chains.size(); ++i) {
    const Eigen::Index end = full.chain_ends[i], count = end - begin;
    if (!runs[i].finite || std::ssize(runs[i].deformations) < count) return not_finite();
    for (Eigen::Index k = 0; k < count; ++k) {
      const auto frame = static_cast<std::size_t>(k);
      const auto u = full.deformations.col(begin + k), x = full.displacements.col(begin + k);
      const Eigen::VectorXd difference = runs[i].deformations[frame] - u;
      const double distance = square(mass, difference), size = square(mass, u);
      positions.add(square(mass, runs[i].displacements[frame] - x), square(mass, x));
      shapes.add(distance, size);
      if (k == count - 1) ends.add(distance, size);
      if (k >= count - std::max<Eigen::Index>(1, count / 10)) settled.add(distance, size);
      note_worst(difference, result);
    }
    begin = end;
  }
  result.position = relative(positions, positions);
  result.shape = relative(shapes, shapes);
  result.end = relative(ends, shapes);
  result.settled = relative(settled, shapes);
  return result;
}

}  // namespace exmat::precompute
