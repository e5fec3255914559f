#include "precompute/targets/target_elements.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "common/elastic/materials.h"
#include "precompute/cubature/element_samples.h"
#include "precompute/cubature/selection.h"
#include "precompute/targets/element_forces.h"
#include "precompute/targets/example_stress.h"
#include "precompute/targets/minimum_finder.h"
#include "precompute/targets/simplex_points.h"
#include "precompute/targets/target_table.h"

namespace exmat::precompute {
namespace {

constexpr double kNoise = 0.1;                  // of the largest example: how far from targets forces are sampled, too
constexpr Eigen::Index kMostRows = 2000;        // of the selection problem
constexpr Eigen::Index kMostCandidates = 6000;  // elements that it chooses from
constexpr Eigen::Index kElementsPerDimension = 12, kLeastElements = 24;  // most of them: 12 d, at least 24
constexpr double kNoForce = 1e-6;  // of the largest force: one that says nothing of the elements

// A force of one example's energy.
struct Sample {
  Eigen::VectorXd y;  ///< d, where
  Eigen::Index example = 0;
};

class ElementChooser {
 public:
  ElementChooser(const ObjectData& object, const RowMatrix& basis, const PoseCoordinates& coordinates,
                 const MeshTarget& target, const TargetElementOptions& options)
      : object_(object),
        coordinates_(coordinates),
        target_(target),
        options_(options),
        samples_(object.mesh, object.materials, basis) {}

  CubatureData choose();

 private:
  RowMatrix weights(int per_dimension) const;
  std::vector<Sample> force_samples() const;
  std::vector<Eigen::Index> candidates() const;
  Eigen::MatrixXd forces(Eigen::Index element, const std::vector<Sample>& samples) const;
  Eigen::MatrixXd sum_of_forces(const std::vector<Sample>& samples) const;
  SelectionProblem problem(const std::vector<Eigen::Index>& elements, const std::vector<Sample>& samples) const;
  CubatureData cubature(const std::vector<Eigen::Index>& elements, const Selection& selection) const;
  double error(const CubatureData& cubature) const;

  const ObjectData& object_;
  const PoseCoordinates& coordinates_;
  const MeshTarget& target_;
  const TargetElementOptions& options_;
  ElementSamples samples_;
  RowMatrix held_out_, exact_;  // weights [N x K], and the targets there in coordinates [N x d]
};

RowMatrix ElementChooser::weights(int per_dimension) const {
  const Eigen::Index count = coordinates_.poses.cols();
  if (count < 2) return RowMatrix::Ones(1, 1);
  if (count <= kMostPolynomialExamples) return spread_points(count, per_dimension);
  std::mt19937_64 generator(options_.seed + static_cast<std::uint64_t>(per_dimension));
  std::exponential_distribution<double> share;
  RowMatrix weights(8 * per_dimension, count);
  for (double& weight : weights.reshaped()) weight = share(generator);
  for (auto row : weights.rowwise()) row /= row.sum();
  return weights;
}

// At targets and beside them.
std::vector<Sample> ElementChooser::force_samples() const {
  const RowMatrix at = weights(3);
  MinimumFinder finder(target_.solver, std::numeric_limits<double>::max(), target_.all.get());
  const RowMatrix minima = finder.find(at, from_blend(target_.solver), "targets that elements are chosen by");
  double scale = 0;
  for (Eigen::Index k = 0; k < coordinates_.poses.cols(); ++k)
    scale = std::max(scale, target_.solver.example(k).norm());
  if (scale == 0) scale = 1;
  std::mt19937_64 generator(options_.seed);
  std::normal_distribution<double> normal;
  const Eigen::Index d = target_.solver.dimension(), count = coordinates_.poses.cols();
  const Eigen::Index stride = std::max<Eigen::Index>(1, 2 * at.rows() * count * d / kMostRows);
  std::vector<Sample> all;
  Eigen::Index number = 0;
  for (Eigen::Index i = 0; i < at.rows(); ++i)
    for (const double noise : {0.0, kNoise * scale / std::sqrt(static_cast<double>(d))}) {
      Eigen::VectorXd y = minima.row(i).allFinite() ? Eigen::VectorXd(minima.row(i).transpose())
                                                    : blend(target_.solver, at.row(i).transpose());
      for (double& entry : y) entry += noise * normal(generator);
      for (Eigen::Index k = 0; k < count; ++k)
        if (number++ % stride == 0) all.push_back({target_.solver.basis() * y, k});
    }
  return all;
}

// All that take part, or a systematic sample of them in their order.
std::vector<Eigen::Index> ElementChooser::candidates() const {
  const auto all = std::ssize(target_.elements);
  if (all <= kMostCandidates) return target_.elements;
  std::vector<Eigen::Index> chosen;
  for (Eigen::Index i = 0; i < kMostCandidates; ++i)
    chosen.push_back(target_.elements[static_cast<std::size_t>(i * all / kMostCandidates)]);
  return chosen;
}

// [d x N] of one element, in unit coordinates, times its volume.
Eigen::MatrixXd ElementChooser::forces(Eigen::Index element, const std::vector<Sample>& samples) const {
  const RowMatrix B = samples_.gradient(element);
  const RowMatrix poses = B * coordinates_.poses;
  const LameParameters lame = samples_.lame(element);
  Eigen::MatrixXd stresses(9, std::ssize(samples));
  with_material(object_.materials.model, [&](auto material) {
    for (Eigen::Index i = 0; i < stresses.cols(); ++i) {
      const Sample& sample = samples[static_cast<std::size_t>(i)];
      const Eigen::Matrix<double, 9, 1> H = B * sample.y, H_example = poses.col(sample.example);
      const Eigen::Matrix3d P =
          example_stress(material, options_.energy_reference, Eigen::Map<const RowMatrix3>(H.data()),
                         Eigen::Map<const RowMatrix3>(H_example.data()), lame);
      stresses.col(i) = samples_.volume(element) * P.reshaped<Eigen::RowMajor>();
    }
  });
  return target_.solver.basis().transpose() * (B.transpose() * stresses);
}

// [d x N] of all elements.
Eigen::MatrixXd ElementChooser::sum_of_forces(const std::vector<Sample>& samples) const {
  const Eigen::Index d = target_.solver.dimension(), count = std::ssize(samples);
  if (target_.all) {
    RowMatrix weights = RowMatrix::Zero(count, coordinates_.poses.cols());
    Eigen::MatrixXd at(coordinates_.poses.rows(), count);
    for (Eigen::Index i = 0; i < count; ++i) {
      const Sample& sample = samples[static_cast<std::size_t>(i)];
      weights(i, sample.example) = 1;
      at.col(i) = sample.y;
    }
    return target_.solver.basis().transpose() * target_.all->forces(weights, at);
  }
  constexpr Eigen::Index kBlock = 256;  // sums do not depend on the number of threads
  const Eigen::Index blocks = (std::ssize(target_.elements) + kBlock - 1) / kBlock;
  std::vector<Eigen::MatrixXd> partial(static_cast<std::size_t>(blocks));
#pragma omp parallel for schedule(dynamic)
  for (Eigen::Index block = 0; block < blocks; ++block) {
    Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(d, count);
    const Eigen::Index end = std::min<Eigen::Index>(std::ssize(target_.elements), (block + 1) * kBlock);
    for (Eigen::Index i = block * kBlock; i < end; ++i)
      sum += forces(target_.elements[static_cast<std::size_t>(i)], samples);
    partial[static_cast<std::size_t>(block)] = std::move(sum);
  }
  Eigen::MatrixXd total = Eigen::MatrixXd::Zero(d, count);
  for (const Eigen::MatrixXd& sum : partial) total += sum;
  return total;
}

SelectionProblem ElementChooser::problem(const std::vector<Eigen::Index>& elements,
                                         const std::vector<Sample>& samples) const {
  const Eigen::Index count = std::ssize(samples);
  const Eigen::MatrixXd total = sum_of_forces(samples);
  const Eigen::VectorXd norms = total.colwise().norm();
  const Eigen::VectorXd scales =
      (norms.array() > kNoForce * norms.maxCoeff()).select(norms.cwiseInverse(), Eigen::VectorXd::Zero(count));
  SelectionProblem problem;
  problem.target = (total * scales.asDiagonal()).reshaped();
  problem.columns.resize(problem.target.size(), std::ssize(elements));
#pragma omp parallel for schedule(dynamic, 16)
  for (std::size_t i = 0; i < elements.size(); ++i)
    problem.columns.col(static_cast<Eigen::Index>(i)) = (forces(elements[i], samples) * scales.asDiagonal()).reshaped();
  return problem;
}

CubatureData ElementChooser::cubature(const std::vector<Eigen::Index>& elements, const Selection& selection) const {
  std::vector<Eigen::Index> chosen;
  for (const Eigen::Index member : selection.members) chosen.push_back(elements[static_cast<std::size_t>(member)]);
  CubatureData data = samples_.data_of(chosen);
  data.weights = selection.weights;
  return data;
}

// Largest distance of the elements' targets from those of all elements, over the largest example.
double ElementChooser::error(const CubatureData& cubature) const {
  const Eigen::Index d = coordinates_.poses.rows();
  runtime::TargetSolver solver;
  if (solver.build(object_.materials.model, cubature, examples_at(coordinates_.poses), RowMatrix::Identity(d, d),
                   options_.energy_reference))
    return std::numeric_limits<double>::infinity();
  auto workspace = solver.make_workspace();
  const Eigen::MatrixXd to_unit = target_.solver.basis().inverse();
  double largest = 0, scale = 0;
  for (Eigen::Index k = 0; k < coordinates_.poses.cols(); ++k)
    scale = std::max(scale, target_.solver.example(k).norm());
  if (scale == 0) return 0;
  for (Eigen::Index i = 0; i < held_out_.rows(); ++i) {
    if (!exact_.row(i).allFinite()) continue;
    Eigen::VectorXd y(d);
    solver.start(held_out_.row(i).transpose(), y);
    solver.solve(held_out_.row(i).transpose(), workspace, y);
    const double distance = (to_unit * (solver.basis() * y) - exact_.row(i).transpose()).norm();
    if (!std::isfinite(distance)) return std::numeric_limits<double>::infinity();
    largest = std::max(largest, distance / scale);
  }
  return largest;
}

CubatureData ElementChooser::choose() {
  held_out_ = weights(5);
  MinimumFinder finder(target_.solver, std::numeric_limits<double>::max(), target_.all.get());
  exact_ = finder.find(held_out_, from_blend(target_.solver), "targets that elements are checked by");
  const std::vector<Sample> samples = force_samples();
  const std::vector<Eigen::Index> elements = candidates();
  const SelectionProblem all = problem(elements, samples);
  const Eigen::Index d = coordinates_.poses.rows();
  const auto most = static_cast<std::size_t>(
      std::min<Eigen::Index>(std::ssize(elements), std::max(kLeastElements, kElementsPerDimension * d)));
  const StopRule accurate{static_cast<std::size_t>(std::max<Eigen::Index>(1, d / 2)), [&](const Selection& selection) {
                            return error(cubature(elements, selection)) <= options_.tolerance;
                          }};
  CubatureData chosen = cubature(elements, select_greedy_swap(all, most, {}, &accurate));
  chosen.heldout_error = error(chosen);
  return chosen;
}

}  // namespace

CubatureData target_elements(const ObjectData& object, const ElasticSystem& system, const PoseCoordinates& coordinates,
                             const MeshTarget& target, const TargetElementOptions& options) {
  const RowMatrix basis = system.extend(coordinates.basis);
  return ElementChooser(object, basis, coordinates, target, options).choose();
}

}  // namespace exmat::precompute
