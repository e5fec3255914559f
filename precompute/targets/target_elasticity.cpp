#include "precompute/targets/target_elasticity.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <random>

#include "common/core/decompositions.h"
#include "common/elastic/materials.h"
#include "precompute/cubature/element_samples.h"
#include "precompute/cubature/selection.h"
#include "runtime/sim/examples/target_table.h"

namespace exmat::precompute {
namespace {

constexpr double kEnergyWeight = 3;
constexpr double kLeastScale = 0.1;  // of the median: forces near the target count by this, not by their own size
constexpr Eigen::Index kHeldoutPairs = 50;
constexpr std::uint64_t kHeldoutSeed = 1'000'003;
constexpr double kDistances[] = {1, 0.5, 0.2};  // of the pose from the target, over that of the pose drawn
constexpr Eigen::Index kMostPerMode = 10;       // elements, where a tolerance asks for more
constexpr Eigen::Index kSumBlock = 256;         // sums do not depend on the number of threads

// Poses [r x N] and targets [d x N].
struct Pairs {
  Eigen::MatrixXd poses, targets;
  Eigen::Index count() const { return poses.cols(); }
};

// Forces of all pairs in the norm of the inverse rest stiffness, [r x N], and energies [N].
struct Response {
  Eigen::MatrixXd forces;
  Eigen::VectorXd energies;
};

// Targets at weights all over the simplex; blends of the examples where there is no table.
Eigen::MatrixXd draw_targets(const TargetSpace& space, Eigen::Index count, std::uint64_t seed) {
  const Eigen::MatrixXd& examples = space.coordinates.poses;
  std::mt19937_64 generator(seed);
  std::exponential_distribution<double> share;
  std::optional<runtime::TargetTable> table;
  if (space.table) table.emplace(*space.table);
  Eigen::MatrixXd targets(examples.rows(), count);
  for (Eigen::Index i = 0; i < count; ++i) {
    Eigen::VectorXd weights(examples.cols()), target(examples.rows());
    for (double& weight : weights) weight = share(generator);
    weights /= weights.sum();
    if (table) {
      auto workspace = table->make_workspace();
      table->evaluate(weights, workspace, target);
      targets.col(i) = target;
    } else {
      targets.col(i) = examples * weights;
    }
  }
  return targets;
}

// A pose drawn, at a distance from the target that takes turns.
Pairs pair_up(const TargetElasticityInput& input, const RowMatrix& poses, std::uint64_t seed) {
  Pairs pairs{poses.transpose(), draw_targets(input.targets, poses.rows(), seed)};
  for (Eigen::Index i = 0; i < pairs.count(); ++i) {
    const Eigen::VectorXd target = input.target_reduced * pairs.targets.col(i);
    pairs.poses.col(i) = target + kDistances[i % std::ssize(kDistances)] * (pairs.poses.col(i) - target);
  }
  return pairs;
}

double median(Eigen::VectorXd values) {
  std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
  return values[values.size() / 2];
}

// 1 over each value, but no more than 1 over kLeastScale of the median.
Eigen::VectorXd scales_of(const Eigen::VectorXd& values) {
  const double least = kLeastScale * median(values);
  return values.unaryExpr([least](double value) { return value > 0 || least > 0 ? 1 / std::max(value, least) : 0; });
}

std::vector<Eigen::Index> with_a_share(const Eigen::VectorXd& shares) {
  std::vector<Eigen::Index> members;
  for (Eigen::Index e = 0; e < shares.size(); ++e)
    if (shares[e] > 0) members.push_back(e);
  return members;
}

class ForceSamples {
 public:
  ForceSamples(const TargetElasticityInput& input, const Eigen::LLT<Eigen::MatrixXd>& stiffness, Pairs pairs)
      : input_(input),
        body_(input.mesh, input.materials, input.basis),
        target_(input.mesh, input.materials, input.displacements),
        shares_(mean_over_elements(input.mesh, body_.elements(), input.shares)),
        members_(with_a_share(shares_)),
        stiffness_(stiffness),
        pairs_(std::move(pairs)) {
    total_ = sum();
    force_scales_ = scales_of(total_.forces.colwise().norm().transpose());
    energy_scales_ = kEnergyWeight * scales_of(total_.energies);
  }

  const std::vector<Eigen::Index>& members() const { return members_; }  // that have a share

  /// Response of one element with its share.
  Response response(Eigen::Index element) const;

  /// Rows of the selection problem.
  Eigen::VectorXd rows(const Response& response) const {
    Eigen::MatrixXd rows(response.forces.rows() + 1, pairs_.count());
    rows.topRows(response.forces.rows()) = response.forces * force_scales_.asDiagonal();
    rows.bottomRows<1>() = response.energies.cwiseProduct(energy_scales_).transpose();
    return rows.reshaped();
  }
  Eigen::VectorXd target_rows() const { return rows(total_); }

  double error(const std::vector<Eigen::Index>& elements, const Eigen::VectorXd& weights) const {
    Eigen::MatrixXd difference = -total_.forces;
    for (std::size_t k = 0; k < elements.size(); ++k)
      difference += weights[static_cast<Eigen::Index>(k)] * response(elements[k]).forces;
    return (difference * force_scales_.asDiagonal()).norm() / std::sqrt(static_cast<double>(pairs_.count()));
  }

 private:
  Response sum() const;

  const TargetElasticityInput& input_;
  ElementSamples body_, target_;
  Eigen::VectorXd shares_;  // e
  std::vector<Eigen::Index> members_;
  const Eigen::LLT<Eigen::MatrixXd>& stiffness_;
  Pairs pairs_;
  Response total_;
  Eigen::VectorXd force_scales_, energy_scales_;
};

Response ForceSamples::response(Eigen::Index element) const {
  const RowMatrix B = body_.gradient(element);
  const Eigen::MatrixXd of_body = B * pairs_.poses, of_target = target_.gradient(element) * pairs_.targets;
  const LameParameters lame = body_.lame(element);
  Eigen::MatrixXd stresses = Eigen::MatrixXd::Zero(9, pairs_.count());
  Response result{{}, Eigen::VectorXd::Zero(pairs_.count())};
  with_material(input_.materials.model, [&](auto material) {
    for (Eigen::Index i = 0; i < pairs_.count(); ++i) {
      const Eigen::Matrix3d H = Eigen::Map<const RowMatrix3>(of_body.col(i).data());
      const Eigen::Matrix3d H_target = Eigen::Map<const RowMatrix3>(of_target.col(i).data());
      const Eigen::Matrix3d target = Eigen::Matrix3d::Identity() + H_target;
      const double volume = shares_[element] * body_.volume(element) * target.determinant();
      if (!(volume > 0)) continue;
      const Eigen::Matrix3d inverse = target.inverse(), relative = (H - H_target) * inverse;
      result.energies[i] = volume * material.energy(relative, lame);
      const Eigen::Matrix3d P = volume * material.first_piola_kirchhoff(relative, lame) * inverse.transpose();
      stresses.col(i) = P.reshaped<Eigen::RowMajor>();
    }
  });
  result.forces = stiffness_.matrixL().solve(B.transpose() * stresses);
  return result;
}

Response ForceSamples::sum() const {
  const Eigen::Index count = std::ssize(members_), blocks = (count + kSumBlock - 1) / kSumBlock;
  const Response nothing{Eigen::MatrixXd::Zero(body_.modes(), pairs_.count()), Eigen::VectorXd::Zero(pairs_.count())};
  std::vector<Response> partial(static_cast<std::size_t>(blocks), nothing);
#pragma omp parallel for schedule(dynamic)
  for (Eigen::Index block = 0; block < blocks; ++block) {
    Response& own = partial[static_cast<std::size_t>(block)];
    for (Eigen::Index i = block * kSumBlock; i < std::min(count, (block + 1) * kSumBlock); ++i) {
      const Response more = response(members_[static_cast<std::size_t>(i)]);
      own.forces += more.forces;
      own.energies += more.energies;
    }
  }
  Response total = nothing;
  for (const Response& own : partial) {
    total.forces += own.forces;
    total.energies += own.energies;
  }
  return total;
}

// All, or a systematic sample in their order.
std::vector<Eigen::Index> candidates_of(const std::vector<Eigen::Index>& members, Eigen::Index most) {
  const Eigen::Index all = std::ssize(members);
  if (all <= most) return members;
  std::vector<Eigen::Index> chosen;
  for (Eigen::Index i = 0; i < most; ++i) chosen.push_back(members[static_cast<std::size_t>(i * all / most)]);
  return chosen;
}

TargetElasticityData data_of(const TargetElasticityInput& input, const std::vector<Eigen::Index>& members,
                             const Eigen::VectorXd& weights) {
  const ElementSamples body(input.mesh, input.materials, input.basis);
  const ElementSamples target(input.mesh, input.materials, input.displacements);
  const Eigen::VectorXd shares = mean_over_elements(input.mesh, body.elements(), input.shares);
  const CubatureData of_body = body.data_of(members);
  TargetElasticityData data;
  data.elements = of_body.elements;
  data.weights = weights.cwiseProduct(shares(members));
  data.volumes = of_body.volumes;
  data.gradient = of_body.gradient;
  data.target_gradient = target.data_of(members).gradient;
  data.youngs_modulus = of_body.youngs_modulus;
  data.poisson_ratio = of_body.poisson_ratio;
  data.control_points = input.targets.table ? input.targets.table->control_points
                                            : RowMatrix(input.targets.coordinates.poses.transpose());
  return data;
}

ForceSamples heldout_samples(const TargetElasticityInput& input, const PoseSource& source,
                             const CubatureOptions& options, const Eigen::LLT<Eigen::MatrixXd>& stiffness) {
  const std::uint64_t seed = options.seed + kHeldoutSeed;
  return {input, stiffness, pair_up(input, draw_heldout_poses(source, kHeldoutPairs, seed), seed)};
}

}  // namespace

TargetElasticityData all_target_elements(const TargetElasticityInput& input) {
  const Elements elements = elements_of(input.mesh, input.materials);
  const std::vector<Eigen::Index> members = with_a_share(mean_over_elements(input.mesh, elements, input.shares));
  return data_of(input, members, Eigen::VectorXd::Ones(std::ssize(members)));
}

TargetElasticityData target_elasticity(const TargetElasticityInput& input, const PoseSource& source,
                                       const CubatureOptions& options) {
  if (options.method == CubatureMethod::kAllElements) return all_target_elements(input);
  const Eigen::LLT<Eigen::MatrixXd> stiffness(source.rest_stiffness);
  const ForceSamples training(input, stiffness,
                              pair_up(input, draw_poses(source, options.training_poses, options.seed), options.seed));
  const ForceSamples heldout = heldout_samples(input, source, options, stiffness);
  SelectionProblem problem{{}, training.target_rows()};
  const std::vector<Eigen::Index> candidates =
      candidates_of(training.members(), std::max<Eigen::Index>(1, options.training_entries / problem.target.size()));
  problem.columns.resize(problem.target.size(), std::ssize(candidates));
#pragma omp parallel for schedule(dynamic, 16)
  for (std::size_t i = 0; i < candidates.size(); ++i)
    problem.columns.col(static_cast<Eigen::Index>(i)) = training.rows(training.response(candidates[i]));
  const auto members = [&](const Selection& selection) {
    std::vector<Eigen::Index> chosen;
    for (const Eigen::Index member : selection.members) chosen.push_back(candidates[static_cast<std::size_t>(member)]);
    return chosen;
  };
  const Eigen::Index modes = input.basis.cols();
  const Eigen::Index most = options.tolerance ? kMostPerMode * modes : options.elements.value_or(2 * modes);
  const StopRule accurate{static_cast<std::size_t>(std::max<Eigen::Index>(1, modes / 4)),
                          [&](const Selection& selection) {
                            return heldout.error(members(selection), selection.weights) <= *options.tolerance;
                          }};
  const Selection selection =
      select_greedy_swap(problem, static_cast<std::size_t>(std::min(most, std::ssize(candidates))), {},
                         options.tolerance ? &accurate : nullptr);
  TargetElasticityData data = data_of(input, members(selection), selection.weights);
  data.heldout_error = heldout.error(members(selection), selection.weights);
  return data;
}

double target_elasticity_error(const TargetElasticityInput& input, const PoseSource& source,
                               const CubatureOptions& options, const IndexVector& elements,
                               const Eigen::VectorXd& weights) {
  const Eigen::LLT<Eigen::MatrixXd> stiffness(source.rest_stiffness);
  const ForceSamples heldout = heldout_samples(input, source, options, stiffness);
  std::vector<Eigen::Index> members;
  std::vector<double> kept;
  for (Eigen::Index j = 0; j < elements.size(); ++j) {
    if (!std::ranges::binary_search(heldout.members(), elements[j])) continue;
    members.push_back(elements[j]);
    kept.push_back(weights[j]);
  }
  return heldout.error(members, Eigen::Map<const Eigen::VectorXd>(kept.data(), std::ssize(kept)));
}

}  // namespace exmat::precompute
