#include "precompute/training/training_stage.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>

#include "common/mesh/geometry.h"
#include "precompute/full_space/full_space_model.h"

namespace exmat::precompute {
namespace {

constexpr double kPeriods = 0.8;            // of the lowest mode, that a segment lasts
constexpr double kPatchDisplacement = 0.1;  // of L, that a patch's force moves it by, about
constexpr double kMostSag = 0.2;            // of L, that gravity of unknown direction bends the body by, about
constexpr int kHeldoutSegments = 2;
constexpr double kGravityDurations = 3;  // of a held-out run, that one of gravity lasts, whose steps have no targets
constexpr std::uint64_t kHeldoutSeed = 7'000'003;

FullSpaceModel full_space_of(const TrainingInput& input, const std::vector<TargetSpace>& spaces) {
  FullSpaceOptions options;
  options.whole_body = input.model.examples.has_value();
  for (const TargetSpace& targets : spaces) options.coordinates.push_back(targets.coordinates);
  if (options.whole_body) options.energy_reference = spaces.front().energy_reference;
  for (std::size_t i = 0; i < input.model.regions.size(); ++i)
    options.regions.push_back({input.model.regions[i].name, spaces[i + (options.whole_body ? 1 : 0)].energy_reference});
  return build_full_space_model(input.model, options);
}

// Displacement of the lowest mode under a unit force where it moves most [m/N].
double compliance(const TrainingInput& input) {
  const Eigen::MatrixXd mode = input.system.extend(input.modes.modes.leftCols(1));
  const double largest = mode.reshaped<Eigen::RowMajor>(mode.rows() / 3, 3).rowwise().squaredNorm().maxCoeff();
  return largest / input.modes.eigenvalues[0];
}

std::vector<Eigen::Index> free_surface(const ObjectData& object) {
  FlagVector on_surface = FlagVector::Zero(object.mesh.vertex_count());
  for (const std::int32_t vertex : object.surface.reshaped()) on_surface[vertex] = object.fixed[vertex] == 0;
  std::vector<Eigen::Index> vertices;
  for (Eigen::Index v = 0; v < on_surface.size(); ++v)
    if (on_surface[v] != 0) vertices.push_back(v);
  return vertices;
}

}  // namespace

TrainingBody training_body(const TrainingInput& input) {
  TrainingBody body;
  body.free = !input.system.constrained();
  body.size = bounding_box_diagonal(input.model.object->mesh.vertices);
  body.angular_frequency = std::sqrt(input.modes.eigenvalues[0]);
  if (input.model.examples) body.groups.emplace_back();
  for (const RegionData& region : input.model.regions) body.groups.push_back(region.name);
  return body;
}

TrainingChains draw_training(const TrainingInput& input, TrainingLoads loads, const TrainingConfig& config,
                             std::uint64_t seed) {
  const ObjectData& object = *input.model.object;
  const TrainingBody body = training_body(input);
  const double soft = compliance(input);
  const MassProperties mass = mass_properties(object.mesh.vertices, input.system.full_mass);
  if (loads.any_gravity && !body.free)
    loads.gravity *= std::min(1.0, kMostSag * body.size / (loads.gravity.norm() * mass.mass * soft));
  const SegmentBody drawn{object.mesh.vertices, mass.centre.transpose(), free_surface(object), body.size,
                          kPatchDisplacement * body.size / soft};
  const double duration = config.seconds.value_or(kPeriods * 2 * std::numbers::pi / body.angular_frequency);
  const std::vector<LoadKind> kinds = loads.duration > 0 ? std::vector<LoadKind>() : kinds_of(loads, body.free);
  const bool apart = kinds.size() > 1;
  TrainingChains chains{
      draw_segments(loads, drawn, {config.segments, duration, seed}),
      draw_segments(loads, drawn, {apart ? 1 : kHeldoutSegments, duration, seed + kHeldoutSeed, false}),
      {.angular_frequency = body.angular_frequency,
       .mass_damping = loads.mass_damping,
       .stiffness_damping = loads.stiffness_damping}};
  for (std::size_t i = 0; apart && i < kinds.size(); ++i) {
    const double longer = kinds[i].name == kGravity ? kGravityDurations : 1;
    std::ranges::move(
        draw_segments(kinds[i].loads, drawn, {1, longer * duration, seed + kHeldoutSeed + 1 + i, false, kinds[i].name}),
        std::back_inserter(chains.heldout));
  }
  return chains;
}

TrainingSet run_training(const TrainingInput& input, const std::vector<TargetSpace>& targets,
                         const TrainingChains& chains) {
  const FullSpaceModel model = full_space_of(input, targets);
  TrainingRunOptions whole = chains.options;
  whole.positions = true;
  return {run_segments(model, chains.runs, chains.options), run_segments(model, chains.heldout, whole)};
}

}  // namespace exmat::precompute
