#include "precompute/cubature/cubature.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <numeric>
#include <random>

#include "common/core/error.h"
#include "common/core/progress.h"
#include "precompute/cubature/element_samples.h"
#include "precompute/cubature/selection.h"

namespace exmat::precompute {
namespace {

constexpr double kEnergyWeight = 3;
constexpr Eigen::Index kHeldoutPoses = 50;
constexpr Eigen::Index kStiffnessPoses = 10;
constexpr int kPasses = 4;  // over meshes that offer a part of their tets in each
// Partial sums over the tets have this fixed size, so that they do not depend on the number of threads.
constexpr Eigen::Index kSumBlock = 256;

// Sum of all tets' responses at the poses, and each tet's mean share of the energy.
struct Totals {
  ElementSamples::Response response;
  Eigen::VectorXd element_energies;
};

Totals sum_responses(const ElementSamples& samples, const RowMatrix& poses) {
  const Eigen::Index blocks = (samples.count() + kSumBlock - 1) / kSumBlock;
  std::vector<ElementSamples::Response> partial(static_cast<std::size_t>(blocks));
  Totals totals{{Eigen::MatrixXd::Zero(samples.modes(), poses.rows()), Eigen::VectorXd::Zero(poses.rows())},
                Eigen::VectorXd(samples.count())};
  Progress progress("element responses", blocks);
#pragma omp parallel for schedule(dynamic)
  for (Eigen::Index block = 0; block < blocks; ++block) {
    auto& sum = partial[static_cast<std::size_t>(block)];
    sum = {Eigen::MatrixXd::Zero(samples.modes(), poses.rows()), Eigen::VectorXd::Zero(poses.rows())};
    for (Eigen::Index t = block * kSumBlock; t < std::min(samples.count(), (block + 1) * kSumBlock); ++t) {
      const auto own = samples.response(t, poses);
      sum.forces += own.forces;
      sum.energies += own.energies;
      totals.element_energies[t] = own.energies.mean();
    }
#pragma omp critical(element_responses_progress)
    progress.advance();
  }
  for (const auto& sum : partial) {
    totals.response.forces += sum.forces;
    totals.response.energies += sum.energies;
  }
  return totals;
}

// Rows of the selection problem: per pose the force in the norm of the inverse rest stiffness over its own norm, and
// the energy.
class TrainingRows {
 public:
  TrainingRows(const PoseSource& source, const ElementSamples::Response& totals) : factor_(source.rest_stiffness) {
    const Eigen::MatrixXd whitened = factor_.matrixL().solve(totals.forces);
    force_scale_ = whitened.colwise().norm().cwiseInverse().transpose();
    energy_scale_ = kEnergyWeight * totals.energies.cwiseInverse();
  }

  Eigen::VectorXd operator()(const ElementSamples::Response& response) const {
    Eigen::MatrixXd rows(response.forces.rows() + 1, response.forces.cols());
    rows.topRows(response.forces.rows()) = factor_.matrixL().solve(response.forces) * force_scale_.asDiagonal();
    rows.bottomRows<1>() = response.energies.cwiseProduct(energy_scale_).transpose();
    return rows.reshaped();
  }

 private:
  Eigen::LLT<Eigen::MatrixXd> factor_;
  Eigen::VectorXd force_scale_, energy_scale_;
};

// A systematic sample of tets over the order of their energies, `kept` always in it. Ascending.
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

SelectionProblem build_problem(const ElementSamples& samples, const RowMatrix& poses, const TrainingRows& rows,
                               const ElementSamples::Response& totals, const std::vector<Eigen::Index>& candidates) {
  SelectionProblem problem;
  problem.target = rows(totals);
  problem.columns.resize(problem.target.size(), static_cast<Eigen::Index>(candidates.size()));
#pragma omp parallel for schedule(dynamic, 16)
  for (std::size_t k = 0; k < candidates.size(); ++k)
    problem.columns.col(static_cast<Eigen::Index>(k)) = rows(samples.response(candidates[k], poses));
  return problem;
}

std::vector<Eigen::Index> to_tets(const std::vector<Eigen::Index>& candidates,
                                  const std::vector<Eigen::Index>& members) {
  std::vector<Eigen::Index> tets;
  for (const Eigen::Index member : members) tets.push_back(candidates[static_cast<std::size_t>(member)]);
  return tets;
}

std::vector<Eigen::Index> to_members(const std::vector<Eigen::Index>& candidates,
                                     const std::vector<Eigen::Index>& tets) {
  std::vector<Eigen::Index> members;
  for (const Eigen::Index tet : tets)
    members.push_back(std::lower_bound(candidates.begin(), candidates.end(), tet) - candidates.begin());
  return members;
}

double root_mean_square(const Eigen::VectorXd& values) {
  return std::sqrt(values.squaredNorm() / static_cast<double>(values.size()));
}

// What the subset gives in place of all elements.
ElementSamples::Response weighted_response(const ElementSamples& samples, const std::vector<Eigen::Index>& elements,
                                           const Eigen::VectorXd& weights, const RowMatrix& poses) {
  ElementSamples::Response sum{Eigen::MatrixXd::Zero(samples.modes(), poses.rows()),
                               Eigen::VectorXd::Zero(poses.rows())};
  for (std::size_t k = 0; k < elements.size(); ++k) {
    const auto own = samples.response(elements[k], poses);
    sum.forces += weights[static_cast<Eigen::Index>(k)] * own.forces;
    sum.energies += weights[static_cast<Eigen::Index>(k)] * own.energies;
  }
  return sum;
}

// Measures subsets against all elements at fixed poses; the totals are summed once.
class ErrorMeter {
 public:
  ErrorMeter(const ElementSamples& samples, const PoseSource& source, const RowMatrix& poses)
      : samples_(samples), poses_(poses), factor_(source.rest_stiffness), totals_(sum_responses(samples, poses)) {}

  const RowMatrix& poses() const { return poses_; }
  const Totals& totals() const { return totals_; }

  double force_error(const std::vector<Eigen::Index>& elements, const Eigen::VectorXd& weights) const {
    return force_error(weighted_response(samples_, elements, weights, poses_));
  }

  CubatureErrors all_errors(const std::vector<Eigen::Index>& elements, const Eigen::VectorXd& weights) const {
    const auto reduced = weighted_response(samples_, elements, weights, poses_);
    const Eigen::VectorXd energy =
        (reduced.energies - totals_.response.energies).cwiseQuotient(totals_.response.energies);
    return {force_error(reduced), root_mean_square(energy), stiffness_error(elements, weights)};
  }

 private:
  double force_error(const ElementSamples::Response& reduced) const {
    const Eigen::MatrixXd difference = factor_.matrixL().solve(reduced.forces - totals_.response.forces);
    const Eigen::MatrixXd reference = factor_.matrixL().solve(totals_.response.forces);
    return root_mean_square(
        (difference.colwise().norm().array() / reference.colwise().norm().array()).matrix().transpose());
  }

  double stiffness_error(const std::vector<Eigen::Index>& elements, const Eigen::VectorXd& weights) const {
    const Eigen::Index count = std::min(kStiffnessPoses, poses_.rows());
    Eigen::VectorXd errors(count);
#pragma omp parallel for schedule(dynamic)
    for (Eigen::Index p = 0; p < count; ++p) {
      const Eigen::VectorXd pose = poses_.row(p);
      Eigen::MatrixXd all = Eigen::MatrixXd::Zero(samples_.modes(), samples_.modes()), reduced = all;
      for (Eigen::Index t = 0; t < samples_.count(); ++t) all += samples_.stiffness(t, pose);
      for (std::size_t k = 0; k < elements.size(); ++k)
        reduced += weights[static_cast<Eigen::Index>(k)] * samples_.stiffness(elements[k], pose);
      errors[p] = (reduced - all).norm() / all.norm();
    }
    return root_mean_square(errors);
  }

  const ElementSamples& samples_;
  const RowMatrix& poses_;
  Eigen::LLT<Eigen::MatrixXd> factor_;
  Totals totals_;
};

Selection select(const SelectionProblem& problem, const CubatureOptions& options, std::size_t count,
                 const std::vector<Eigen::Index>& start, const StopRule* stop) {
  if (options.method == CubatureMethod::kGreedy) return select_greedy_random(problem, count, start, stop, options.seed);
  if (options.method == CubatureMethod::kNnHtp) return select_hard_thresholding(problem, count);
  return select_greedy_swap(problem, count, start, stop);
}

struct Choice {
  std::vector<Eigen::Index> elements;
  Eigen::VectorXd weights;
};

Choice every_element(Eigen::Index tets) {
  Choice choice{std::vector<Eigen::Index>(static_cast<std::size_t>(tets)), Eigen::VectorXd::Ones(tets)};
  std::iota(choice.elements.begin(), choice.elements.end(), 0);
  return choice;
}

Choice choose(const ElementSamples& samples, const PoseSource& source, const CubatureOptions& options,
              const ErrorMeter& training, const ErrorMeter* heldout) {
  if (options.method == CubatureMethod::kAllElements) return every_element(samples.count());
  const RowMatrix& poses = training.poses();
  const Totals& totals = training.totals();
  const TrainingRows rows(source, totals.response);
  const Eigen::Index limit =
      std::max<Eigen::Index>(1, options.training_entries / ((samples.modes() + 1) * poses.rows()));
  const int passes = samples.count() > limit ? kPasses : 1;
  const auto r = static_cast<std::size_t>(samples.modes());
  const bool open_ended = options.tolerance.has_value();
  const auto target = open_ended ? std::min<std::size_t>(10 * r, static_cast<std::size_t>(samples.count()))
                                 : static_cast<std::size_t>(options.elements.value_or(static_cast<int>(2 * r)));
  Choice choice;
  Progress progress("cubature passes", passes);
  for (int pass = 0; pass < passes; ++pass) {
    const auto candidates = choose_candidates(totals.element_energies, choice.elements, limit,
                                              options.seed + 1000 + static_cast<unsigned>(pass));
    const auto problem = build_problem(samples, poses, rows, totals.response, candidates);
    const StopRule tolerance_met{std::max<std::size_t>(1, r / 4), [&](const Selection& selection) {
                                   return heldout->force_error(to_tets(candidates, selection.members),
                                                               selection.weights) <= *options.tolerance;
                                 }};
    const std::size_t count = target * static_cast<std::size_t>(pass + 1) / static_cast<std::size_t>(passes);
    const auto selection =
        select(problem, options, count, to_members(candidates, choice.elements), open_ended ? &tolerance_met : nullptr);
    choice = {to_tets(candidates, selection.members), selection.weights};
    progress.advance();
    if (open_ended && heldout->force_error(choice.elements, choice.weights) <= *options.tolerance) break;
  }
  return choice;
}

void set_elements(const ElementSamples& samples, const TetMaterials& materials, const Choice& choice,
                  CubatureData& data) {
  const auto s = static_cast<Eigen::Index>(choice.elements.size());
  data.elements.resize(s);
  data.weights = choice.weights;
  data.volumes.resize(s);
  data.gradient.resize(9 * s, samples.modes());
  data.youngs_modulus.resize(s);
  data.poisson_ratio.resize(s);
  for (Eigen::Index j = 0; j < s; ++j) {
    const Eigen::Index tet = choice.elements[static_cast<std::size_t>(j)];
    data.elements[j] = static_cast<std::int32_t>(tet);
    data.volumes[j] = samples.volume(tet);
    data.gradient.middleRows(9 * j, 9) = samples.gradient(tet);
    data.youngs_modulus[j] = materials.youngs_modulus[tet];
    data.poisson_ratio[j] = materials.poisson_ratio[tet];
  }
}

void require_sound_options(const CubatureOptions& options, Eigen::Index tets) {
  if (options.elements && *options.elements > tets)
    throw InputError({"", "/cubature/elements", "at most the number of tets, " + std::to_string(tets),
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
  CubatureData data;
  data.method = CubatureMethod::kAllElements;
  set_elements(samples, materials, every_element(samples.count()), data);
  return data;
}

CubatureData with_basis(const CubatureData& other, const TetMesh& mesh, const TetMaterials& materials,
                        const RowMatrix& basis) {
  Choice choice;
  choice.elements.assign(other.elements.begin(), other.elements.end());
  choice.weights = other.weights;
  CubatureData data;
  data.method = other.method;
  set_elements(ElementSamples(mesh, materials, basis), materials, choice, data);
  return data;
}

CubatureErrors cubature_errors(const TetMesh& mesh, const TetMaterials& materials, const PoseSource& source,
                               const std::vector<Eigen::Index>& elements, const Eigen::VectorXd& weights,
                               const RowMatrix& poses) {
  const ElementSamples samples(mesh, materials, source.basis);
  return ErrorMeter(samples, source, poses).all_errors(elements, weights);
}

CubatureData build_cubature(const TetMesh& mesh, const TetMaterials& materials, const PoseSource& source,
                            const CubatureOptions& options) {
  require_sound_options(options, mesh.tet_count());
  const ElementSamples samples(mesh, materials, source.basis);
  const RowMatrix training_poses = draw_poses(source, options.training_poses, options.seed);
  const ErrorMeter training(samples, source, training_poses);
  CubatureData data;
  data.method = options.method;
  if (!options.measured && !options.tolerance) {
    set_elements(samples, materials, choose(samples, source, options, training, nullptr), data);
    return data;
  }
  data.heldout_poses = draw_heldout_poses(source, kHeldoutPoses, options.seed + 1'000'003);
  const ErrorMeter heldout(samples, source, data.heldout_poses);
  const auto choice = choose(samples, source, options, training, &heldout);

  set_elements(samples, materials, choice, data);
  data.training_error = training.force_error(choice.elements, choice.weights);
  const auto errors = heldout.all_errors(choice.elements, choice.weights);
  data.heldout_error = errors.force;
  data.heldout_energy_error = errors.energy;
  data.heldout_stiffness_error = errors.stiffness;
  if (options.tolerance && data.heldout_error > *options.tolerance)
    throw WorkError(
        fmt::format("cubature.tolerance: expected a held-out error of at most {:.3g}, found {:.3g} with {} elements; "
                    "raise it, or lower basis.size",
                    *options.tolerance, data.heldout_error, data.elements.size()));
  return data;
}

}  // namespace exmat::precompute
