#include "precompute/training/fidelity.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <limits>

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

// The kind of load whose errors are reported; empty where the runs are not divided by kind.
std::string worst_text(const std::vector<Chain>& runs, const std::string& kind) {
  if (!kind.empty()) return fmt::format("; worst under {} alone", kind);
  const bool apart = std::ranges::any_of(runs, [](const Chain& chain) { return !chain.front().kind.empty(); });
  return apart ? "; worst under all loads together" : "";
}

struct Range {
  double low = std::numeric_limits<double>::infinity(), high = -low;

  void add(double value) {
    low = std::min(low, value);
    high = std::max(high, value);
  }
  bool empty() const { return low > high; }
};

std::string text_of(const Range& range) {
  const std::string low = fmt::format("{:.2g}", range.low), high = fmt::format("{:.2g}", range.high);
  return low == high ? low : fmt::format("{} to {}", low, high);
}

// Ranges of the sizes of loads in runs [m/s^2, 1/s^2, 1, 1, N, m/s, s]; empty for kinds that the runs lack.
struct Sizes {
  Range gravity, stiffness, elasticity, bias, force, speed, duration;

  Sizes(const std::vector<Chain>& runs, bool free) {
    for (const Chain& chain : runs) {
      double seconds = 0;
      for (const Segment& segment : chain) {
        add(segment, free);
        seconds += segment.duration;
      }
      duration.add(seconds);
    }
  }

 private:
  void add(const Segment& segment, bool free) {
    if (const double g = segment.gravity.norm(); g > 0 && !free) gravity.add(g);
    for (const runtime::ExampleSettings& examples : segment.examples) {
      if (!runtime::acts(examples)) continue;
      (examples.elastic ? elasticity : stiffness).add(examples.stiffness);
      bias.add(examples.bias);
    }
    for (const VertexForceConfig& push : segment.forces)
      force.add(push.force.norm() * static_cast<double>(push.vertices.size()));
    if (segment.obstacle) speed.add(segment.motion.linear_velocity.norm());
  }
};

}  // namespace

std::string warning_of(const FidelityData& fidelity) {
  constexpr double kWorse = 1.1, kSmall = 0.02;  // times the error of modes; an error that is none
  constexpr double kFar = 0.1;                   // an error that shows
  const double error = 100 * fidelity.shape_error;
  if (fidelity.shape_error > std::max(kWorse * fidelity.modal_error, kSmall))
    return fmt::format(
        "training made the body worse: it is {:.2g} % from the full space in held-out runs, modes alone with all "
        "elements {:.2g} %; {}, or basis.training \"none\"",
        error, 100 * fidelity.modal_error, fidelity.advice);
  if (fidelity.shape_error > kFar)
    return fmt::format("in held-out runs the body is {:.2g} % from the full space: {}", error, fidelity.advice);
  return "";
}

std::string tried_text(const std::vector<Chain>& runs, const TrainingRunOptions& options, bool free) {
  const Sizes sizes(runs, free);
  std::vector<std::string> tried;
  const auto add = [&](const Range& range, const char* text) {
    if (!range.empty()) tried.push_back(fmt::format(fmt::runtime(text), text_of(range)));
  };
  add(sizes.gravity, "gravity of {} m/s^2");
  add(sizes.stiffness, "example forces of kappa {} 1/s^2");
  add(sizes.elasticity, "elastic example forces of factor {}");
  add(sizes.bias, "bias {}");
  add(sizes.force, "forces of {} N on vertices");
  add(sizes.speed, "throws at a plane with {} m/s");
  if (tried.empty()) tried.emplace_back("no load");
  return fmt::format("{}, in runs of {} s with mass damping {:.2g} 1/s and stiffness damping {:.2g} s",
                     fmt::join(tried, ", "), text_of(sizes.duration), options.mass_damping.value_or(0),
                     stiffness_damping_of(options));
}

std::string untried_text(const std::vector<Chain>& runs, bool free) {
  const Sizes sizes(runs, free);
  std::vector<std::string> untried;
  if (sizes.gravity.empty() && !free) untried.emplace_back("gravity");
  untried.emplace_back(sizes.bias.empty() ? "example forces" : "stiffer examples");
  if (sizes.force.empty()) untried.emplace_back("forces on vertices");
  if (sizes.speed.empty()) untried.emplace_back("contact");
  return fmt::format("{}, hands, stronger or weaker loads, longer runs, other damping", fmt::join(untried, ", "));
}

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
  const std::vector<Chain>& runs = input.chains.heldout;
  fidelity.advice = fmt::format("{}{}; tried: {}; not tried: {}", advice(input, fidelity, mass),
                                worst_text(runs, input.final_run.kind), tried_text(runs, input.chains.options, free),
                                untried_text(runs, free));
  return fidelity;
}

}  // namespace exmat::precompute
