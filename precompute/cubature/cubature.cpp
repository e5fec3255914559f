#include "precompute/cubature/cubature.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <numeric>
#include <random>

#include "common/core/decompositions.h"
#include "common/core/error.h"
#include "common/core/progress.h"
#include "precompute/cubature/element_samples.h"
#include "precompute/cubature/selection.h"

namespace exmat::precompute {
namespace {

constexpr double kEnergyWeight = 3;
constexpr Eigen::Index kHeldoutPoses = 50;
constexpr Eigen::Index kStiffnessPoses = 10;
constexpr int kPasses = 4;                          // over meshes that offer a part of their elements in each
constexpr Eigen::Index kCandidatesPerElement = 16;  // in each of these passes: more lower no held-out error

// The body in coordinates y = L^T q in which its stiffness at rest is the identity, L L^T = U^T K U: the norm of forces
// there is that of the inverse rest stiffness.
class UnitBody {
 public:
  UnitBody(const TetMesh& mesh, const TetMaterials& materials, const PoseSource& source)
      : factor_(source.rest_stiffness), basis_(source.basis), samples_(mesh, materials, basis_) {
    factor_.matrixU().solveInPlace<Eigen::OnTheRight>(basis_);
  }

  const ElementSamples& samples() const { return samples_; }
  PoseLanes lanes(const RowMatrix& poses) const { return PoseLanes(poses * factor_.matrixL()); }

 private:
  Eigen::LLT<Eigen::MatrixXd> factor_;
  RowMatrix basis_;
  ElementSamples samples_;
};

// Sum of all elements' responses at the poses, and each one's mean share of the energy.
struct Totals {
  Responses responses;
  Eigen::VectorXd element_energies;
};

Totals sum_responses(const ElementSamples& samples, const PoseLanes& poses) {
  const std::vector<Part> parts = parts_of(samples.count());
  const Responses zeros(samples.modes(), poses);
  std::vector<Responses> partial(parts.size(), zeros);
  Totals totals{zeros, Eigen::VectorXd(samples.count())};
  Progress progress("element responses", std::ssize(parts));
#pragma omp parallel for schedule(dynamic)
  for (std::size_t i = 0; i < parts.size(); ++i) {
    Responses own = zeros;
    for (Eigen::Index t = parts[i].begin; t < parts[i].end; ++t) {
      samples.respond(t, poses, own);
      partial[i].numbers() += own.numbers();
      totals.element_energies[t] = own.mean_energy();
    }
#pragma omp critical(element_responses_progress)
    progress.advance();
  }
  for (const Responses& sum : partial) totals.responses.numbers() += sum.numbers();
  return totals;
}

// Rows of the selection problem: per pose the force in the norm of the inverse rest stiffness over its own norm, and
// the energy.
class TrainingRows {
 public:
  explicit TrainingRows(const Responses& totals)
      : force_scale_(Eigen::ArrayXd::Zero(totals.groups() * runtime::kLanes)), energy_scale_(force_scale_) {
    const Eigen::Index count = totals.energies().size();
    force_scale_.head(count) = totals.force_norms().array().inverse();
    energy_scale_.head(count) = kEnergyWeight * totals.energies().array().inverse();
  }

  Eigen::VectorXd operator()(Responses responses) const {
    for (Eigen::Index g = 0; g < responses.groups(); ++g) {
      auto group = responses.group(g);
      const Eigen::Index r = group.cols() - 1;
      group.leftCols(r).colwise() *= force_scale_.segment<runtime::kLanes>(g * runtime::kLanes);
      group.col(r) *= energy_scale_.segment<runtime::kLanes>(g * runtime::kLanes);
    }
    return responses.numbers();
  }

 private:
  Eigen::ArrayXd force_scale_, energy_scale_;
};

// A systematic sample of elements over the order of their energies, `kept` always in it. Ascending.
std::vector<Eigen::Index> choose_candidates(const Eigen::VectorXd& energies, const std::vector<Eigen::Index>& kept,
                                            Eigen::Index limit, std::uint64_t seed) {
  std::vector<Eigen::Index> order(static_cast<std::size_t>(energies.size()));
  std::iota(order.begin(), order.end(), 0);
  if (energies.size() <= limit) return order;
  std::stable_sort(order.begin(), order.end(),
                   [&](Eigen::Index a, Eigen::Index b) { return energies[a] > energies[b]; });
  std::mt19937_64 generator(seed);
  const double stride = static_cast<double>(order.size()) / static_cast<double>(limit);
  std::uniform_real_distribution<double> within(0, stride);
  std::vector<Eigen::Index> chosen(kept);
  for (Eigen::Index k = 0; k < limit; ++k) {
    const double position = static_cast<double>(k) * stride + within(generator);
    chosen.push_back(order[std::min(order.size() - 1, static_cast<std::size_t>(position))]);
  }
  std::sort(chosen.begin(), chosen.end());
  chosen.erase(std::unique(chosen.begin(), chosen.end()), chosen.end());
  return chosen;
}

SelectionProblem build_problem(const ElementSamples& samples, const PoseLanes& poses, const TrainingRows& rows,
                               const Responses& totals, const std::vector<Eigen::Index>& candidates) {
  SelectionProblem problem;
  problem.target = rows(totals);
  problem.columns.resize(problem.target.size(), static_cast<Eigen::Index>(candidates.size()));
#pragma omp parallel
  {
    Responses own(samples.modes(), poses);
#pragma omp for schedule(dynamic, 16)
    for (std::size_t k = 0; k < candidates.size(); ++k) {
      samples.respond(candidates[k], poses, own);
      problem.columns.col(static_cast<Eigen::Index>(k)) = rows(own);
    }
  }
  return problem;
}

std::vector<Eigen::Index> elements_of_members(const std::vector<Eigen::Index>& candidates,
                                              const std::vector<Eigen::Index>& members) {
  std::vector<Eigen::Index> elements;
  for (const Eigen::Index member : members) elements.push_back(candidates[static_cast<std::size_t>(member)]);
  return elements;
}

std::vector<Eigen::Index> to_members(const std::vector<Eigen::Index>& candidates,
                                     const std::vector<Eigen::Index>& elements) {
  std::vector<Eigen::Index> members;
  for (const Eigen::Index element : elements)
    members.push_back(std::lower_bound(candidates.begin(), candidates.end(), element) - candidates.begin());
  return members;
}

struct Choice {
  std::vector<Eigen::Index> elements;
  Eigen::VectorXd weights;
};

Choice every_element(Eigen::Index count) {
  Choice choice{std::vector<Eigen::Index>(static_cast<std::size_t>(count)), Eigen::VectorXd::Ones(count)};
  std::iota(choice.elements.begin(), choice.elements.end(), 0);
  return choice;
}

double root_mean_square(const Eigen::VectorXd& values) {
  return std::sqrt(values.squaredNorm() / static_cast<double>(values.size()));
}

// Responses of the subset in place of all elements.
Responses weighted_response(const ElementSamples& samples, const std::vector<Eigen::Index>& elements,
                            const Eigen::VectorXd& weights, const PoseLanes& poses) {
  const std::vector<Part> parts = parts_of(std::ssize(elements));
  Responses sum(samples.modes(), poses);
  std::vector<Responses> partial(parts.size(), sum);
#pragma omp parallel for schedule(dynamic)
  for (std::size_t i = 0; i < parts.size(); ++i) {
    Responses own(samples.modes(), poses);
    for (Eigen::Index k = parts[i].begin; k < parts[i].end; ++k) {
      samples.respond(elements[static_cast<std::size_t>(k)], poses, own);
      partial[i].numbers() += weights[k] * own.numbers();
    }
  }
  for (const Responses& own : partial) sum.numbers() += own.numbers();
  return sum;
}

// Measures subsets against all elements at fixed poses; the totals are summed once.
class ErrorMeter {
 public:
  ErrorMeter(const UnitBody& body, const RowMatrix& poses)
      : body_(body), poses_(poses), lanes_(body.lanes(poses)), totals_(sum_responses(body.samples(), lanes_)) {}

  const PoseLanes& lanes() const { return lanes_; }
  const Totals& totals() const { return totals_; }

  double force_error(const std::vector<Eigen::Index>& elements, const Eigen::VectorXd& weights) const {
    return force_error(weighted_response(body_.samples(), elements, weights, lanes_));
  }

  // `samples` has the basis that stiffness is measured in.
  CubatureErrors all_errors(const ElementSamples& samples, const std::vector<Eigen::Index>& elements,
                            const Eigen::VectorXd& weights) const {
    const Responses reduced = weighted_response(body_.samples(), elements, weights, lanes_);
    const Eigen::VectorXd all = totals_.responses.energies();
    return {force_error(reduced), root_mean_square((reduced.energies() - all).cwiseQuotient(all)),
            stiffness_error(samples, elements, weights)};
  }

 private:
  double force_error(Responses difference) const {
    difference.numbers() -= totals_.responses.numbers();
    return root_mean_square(difference.force_norms().cwiseQuotient(totals_.responses.force_norms()));
  }

  double stiffness_error(const ElementSamples& samples, const std::vector<Eigen::Index>& elements,
                         const Eigen::VectorXd& weights) const {
    const Eigen::Index count = std::min(kStiffnessPoses, poses_.rows());
    const PoseLanes lanes(poses_.topRows(count));
    const Choice every = every_element(samples.count());
    const auto all = samples.stiffness(every.elements, every.weights, lanes);
    const auto reduced = samples.stiffness(elements, weights, lanes);
    Eigen::VectorXd errors(count);
    for (Eigen::Index p = 0; p < count; ++p) {
      const auto at = static_cast<std::size_t>(p);
      errors[p] = (reduced[at] - all[at]).norm() / all[at].norm();
    }
    return root_mean_square(errors);
  }

  const UnitBody& body_;
  const RowMatrix& poses_;
  PoseLanes lanes_;
  Totals totals_;
};

Selection select(const SelectionProblem& problem, const CubatureOptions& options, std::size_t count,
                 const std::vector<Eigen::Index>& start, const StopRule* stop) {
  if (options.method == CubatureMethod::kGreedy) return select_greedy_random(problem, count, start, stop, options.seed);
  if (options.method == CubatureMethod::kNnHtp) return select_hard_thresholding(problem, count);
  return select_greedy_swap(problem, count, start, stop);
}

Choice choose(const ElementSamples& samples, const CubatureOptions& options, const ErrorMeter& training,
              const ErrorMeter* heldout) {
  if (options.method == CubatureMethod::kAllElements) return every_element(samples.count());
  const PoseLanes& poses = training.lanes();
  const Totals& totals = training.totals();
  const TrainingRows rows(totals.responses);
  const auto r = static_cast<std::size_t>(samples.modes());
  const bool open_ended = options.tolerance.has_value();
  const auto target = open_ended ? std::min<std::size_t>(10 * r, static_cast<std::size_t>(samples.count()))
                                 : static_cast<std::size_t>(options.elements.value_or(static_cast<int>(2 * r)));
  const Eigen::Index most =
      std::max<Eigen::Index>(1, options.training_entries / ((samples.modes() + 1) * poses.count()));
  const bool all_fit = samples.count() <= most;
  const int passes = all_fit ? 1 : kPasses;
  const Eigen::Index limit =
      all_fit ? most : std::min<Eigen::Index>(most, kCandidatesPerElement * static_cast<Eigen::Index>(target));
  Choice choice;
  Progress progress("cubature passes", passes);
  for (int pass = 0; pass < passes; ++pass) {
    const auto candidates = choose_candidates(totals.element_energies, choice.elements, limit,
                                              options.seed + 1000 + static_cast<unsigned>(pass));
    const auto problem = build_problem(samples, poses, rows, totals.responses, candidates);
    const StopRule tolerance_met{std::max<std::size_t>(1, r / 4), [&](const Selection& selection) {
                                   return heldout->force_error(elements_of_members(candidates, selection.members),
                                                               selection.weights) <= *options.tolerance;
                                 }};
    const std::size_t count = target * static_cast<std::size_t>(pass + 1) / static_cast<std::size_t>(passes);
    const auto selection =
        select(problem, options, count, to_members(candidates, choice.elements), open_ended ? &tolerance_met : nullptr);
    choice = {elements_of_members(candidates, selection.members), selection.weights};
    progress.advance();
    if (open_ended && heldout->force_error(choice.elements, choice.weights) <= *options.tolerance) break;
  }
  return choice;
}

CubatureData data_of(const ElementSamples& samples, const Choice& choice) {
  CubatureData data = samples.data_of(choice.elements);
  data.weights = choice.weights;
  data.variance = samples.variance();
  return data;
}

Choice choice_of(const CubatureData& data) { return {{data.elements.begin(), data.elements.end()}, data.weights}; }

struct HeldoutMeter {
  RowMatrix poses;
  ErrorMeter meter;

  HeldoutMeter(const UnitBody& body, const PoseSource& source, const CubatureOptions& options)
      : poses(draw_heldout_poses(source, kHeldoutPoses, options.seed + 1'000'003)), meter(body, poses) {}

  void measure(const ElementSamples& samples, const Choice& choice, CubatureData& data) const {
    const CubatureErrors errors = meter.all_errors(samples, choice.elements, choice.weights);
    data.heldout_poses = poses;
    data.heldout_error = errors.force;
    data.heldout_energy_error = errors.energy;
    data.heldout_stiffness_error = errors.stiffness;
  }
};

void require_sound_options(const CubatureOptions& options, Eigen::Index elements) {
  if (options.elements && *options.elements > elements)
    throw InputError({"", "/cubature/elements",
                      "at most the number of elements of the mesh, " + std::to_string(elements),
                      std::to_string(*options.elements), ""});
  if (options.tolerance && options.method == CubatureMethod::kNnHtp)
    throw InputError({"", "/cubature/tolerance", "cubature.elements with method nn_htp, which needs a fixed number",
                      "a tolerance", ""});
  if (options.method == CubatureMethod::kAllElements && (options.elements || options.tolerance))
    throw InputError({"", options.elements ? "/cubature/elements" : "/cubature/tolerance",
                      "neither elements nor tolerance with method all_elements", "one of them", ""});
}

}  // namespace

CubatureData all_elements(const TetMesh& mesh, const TetMaterials& materials, const RowMatrix& basis) {
  const ElementSamples samples(mesh, materials, basis);
  CubatureData data = data_of(samples, every_element(samples.count()));
  data.method = CubatureMethod::kAllElements;
  return data;
}

CubatureData with_basis(const CubatureData& other, const TetMesh& mesh, const TetMaterials& materials,
                        const RowMatrix& basis) {
  CubatureData data = data_of(ElementSamples(mesh, materials, basis), choice_of(other));
  data.method = other.method;
  return data;
}

CubatureErrors cubature_errors(const TetMesh& mesh, const TetMaterials& materials, const PoseSource& source,
                               const std::vector<Eigen::Index>& elements, const Eigen::VectorXd& weights,
                               const RowMatrix& poses) {
  const UnitBody body(mesh, materials, source);
  return ErrorMeter(body, poses).all_errors(ElementSamples(mesh, materials, source.basis), elements, weights);
}

CubatureData build_cubature(const TetMesh& mesh, const TetMaterials& materials, const PoseSource& source,
                            const CubatureOptions& options) {
  const ElementSamples samples(mesh, materials, source.basis);
  require_sound_options(options, samples.count());
  const UnitBody body(mesh, materials, source);
  const RowMatrix training_poses = draw_poses(source, options.training_poses, options.seed);
  const ErrorMeter training(body, training_poses);
  std::optional<HeldoutMeter> heldout;
  if (options.measured || options.tolerance) heldout.emplace(body, source, options);
  const Choice choice = choose(body.samples(), options, training, heldout ? &heldout->meter : nullptr);
  CubatureData data = data_of(samples, choice);
  data.method = options.method;
  data.training_error = training.force_error(choice.elements, choice.weights);
  if (heldout) heldout->measure(samples, choice, data);
  if (options.tolerance && data.heldout_error > *options.tolerance)
    throw WorkError(
        fmt::format("cubature.tolerance: expected a held-out error of at most {:.3g}, found {:.3g} with {} elements; "
                    "raise it, or lower basis.size",
                    *options.tolerance, data.heldout_error, data.elements.size()));
  return data;
}

CubatureData measured_cubature(const CubatureData& data, const TetMesh& mesh, const TetMaterials& materials,
                               const PoseSource& source, const CubatureOptions& options) {
  const UnitBody body(mesh, materials, source);
  CubatureData measured = data;
  HeldoutMeter(body, source, options).measure(ElementSamples(mesh, materials, source.basis), choice_of(data), measured);
  return measured;
}

}  // namespace exmat::precompute
