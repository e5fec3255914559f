#include "precompute/training/fidelity.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

#include "common/mesh/assembly.h"
#include "common/mesh/geometry.h"

namespace exmat::precompute {
namespace {

constexpr double kGood = 0.02;      // shape error that needs no advice
constexpr double kShare = 1.5;      // of the error with all elements: more than that is cubature's
constexpr double kLost = 0.25;      // of a pose: more eigenfunctions are worth while
constexpr double kUnlearned = 3;    // times what the basis loses of its own training: others would teach it more
constexpr double kNotFinite = 1e9;  // stands for errors of runs that did not stay finite

double finite(double error) { return std::isfinite(error) ? error : kNotFinite; }

// Share of the squares of the norms that is in the span of the basis.
double captured(const SparseMatrix& mass, const RowMatrix& basis, const Eigen::MatrixXd& motions) {
  const Eigen::MatrixXd weighted = mass * motions;
  const double all = motions.cwiseProduct(weighted).sum();
  return all > 0 ? std::clamp((basis.transpose() * weighted).squaredNorm() / all, 0.0, 1.0) : 1.0;
}

double largest_loss(const ReducedModel& model) {
  double largest = 0;
  const auto look = [&](const ExampleSet& set) {
    for (const ExampleData& example : set.examples) largest = std::max(largest, example.shape_space_error);
  };
  if (model.examples) look(*model.examples);
  for (const RegionData& region : model.regions) look(region.examples);
  return largest;
}

double largest_target_error(const ReducedModel& model) {
  double largest = 0;
  const auto look = [&](const auto& table, const auto& space) {
    if (table) largest = std::max(largest, table->error);
    if (space) largest = std::max(largest, space->error);
  };
  look(model.targets, model.target_space);
  for (const RegionData& region : model.regions) look(region.targets, region.target_space);
  return largest;
}

// Share of the squared norms of all of the training that the basis does not hold.
double lost_of_training(const FidelityInput& input, const SparseMatrix& mass) {
  const RowMatrix& basis = input.model.modal->basis;
  if (input.training.snapshots.rows() != basis.rows()) return 0;
  return 1 - captured(mass, basis, input.training.snapshots);
}

std::string advice(const FidelityInput& input, const FidelityData& fidelity, const SparseMatrix& mass) {
  const auto r = input.model.modal->basis.cols();
  const auto s = input.model.cubature->elements.size();
  if (fidelity.shape_error > kShare * fidelity.all_elements_error && fidelity.shape_error > kGood)
    return fmt::format("more cubature.elements than {}: with all of them the error is {:.2g} %", s,
                       100 * fidelity.all_elements_error);
  if (fidelity.shape_error > kGood) {
    if (1 - fidelity.captured_energy > kUnlearned * lost_of_training(input, mass))
      return "more basis.training_segments: the basis holds its own training much better than other runs";
    return fmt::format("a larger basis.size than {}", r);
  }
  if (const double lost = largest_loss(input.model); lost > kLost)
    return fmt::format(
        "near the full space under the loads that were tried; more shape_space.eigenfunctions would bring it nearer to "
        "the poses, of which they lose {:.0f} %",
        100 * lost);
  return "near the full space under what was tried; train on more (basis.loads, or a scene) if it is to serve other "
         "loads";
}

}  // namespace

FidelityData fidelity_of(const FidelityInput& input) {
  const ReducedModel& model = input.model;
  const SparseMatrix mass = expand_to_vectors(scalar_mass(model.object->mesh, model.object->materials.density));
  FidelityData fidelity;
  fidelity.loads = input.loads;
  fidelity.reference = name_of(input.space);
  fidelity.basis = input.trained ? "trained" : "modal";
  fidelity.training_runs = input.training.segments;
  fidelity.heldout_runs = input.heldout.segments;
  fidelity.position_error = finite(input.final_run.position);
  fidelity.shape_error = finite(input.final_run.shape);
  fidelity.end_error = finite(input.final_run.end);
  fidelity.settled_error = finite(input.final_run.settled);
  fidelity.all_elements_error = finite(input.exact_run.shape);
  fidelity.modal_error = finite(input.modal_run.shape);
  fidelity.captured_energy = captured(mass, model.modal->basis, input.heldout.deformations);
  fidelity.target_error = largest_target_error(model);
  fidelity.worst_vertex = input.final_run.worst_vertex;
  fidelity.worst_distance = finite(input.final_run.worst_distance / bounding_box_diagonal(model.object->mesh.vertices));
  const bool free = !model.object->fixed.any();
  fidelity.advice = fmt::format("{}; tried: {}; not tried: {}", advice(input, fidelity, mass),
                                tried_text(input.tried, free), untried_text(input.tried, free));
  return fidelity;
}

}  // namespace exmat::precompute
