#include "precompute/targets/target_space.h"

#include <algorithm>
#include <fmt/format.h>
#include <utility>

#include "common/core/decompositions.h"
#include "common/core/log.h"
#include "common/mesh/elements.h"
#include "precompute/targets/minimum_finder.h"
#include "precompute/targets/simplex_points.h"
#include "precompute/targets/table_error.h"
#include "precompute/targets/target_elements.h"
#include "precompute/targets/target_table.h"
#include "runtime/sim/examples/bernstein_basis.h"

namespace exmat::precompute {
namespace {

using runtime::TargetSolver;

constexpr double kShare = 0.1;              // of the tolerance that the space may take
constexpr int kRounds = 4;                  // in which weights whose targets the space misses are added
constexpr double kNoDirection = 1e-9;       // of the largest example: a direction of poses that is rounding
constexpr double kManyTolerance = 100;      // times the tolerance, of more examples than one polynomial is for
constexpr int kCheckedTogether[] = {2, 3};  // of many examples, whose targets the space is checked by
constexpr int kTableChecks = 8;  // targets of all tets on every edge of the simplex, that a table is checked by

bool is_of_many(Eigen::Index examples) { return examples > kMostPolynomialExamples; }

// Each example half, the rest pose the other half.
RowMatrix halves(Eigen::Index examples) {
  RowMatrix weights = RowMatrix::Zero(examples - 1, examples);
  weights.col(0).setConstant(0.5);
  weights.rightCols(examples - 1).diagonal().setConstant(0.5);
  return weights;
}

// Weights that targets are solved for first: corners, edges, faces and the inside of the simplex.
RowMatrix first_weights(Eigen::Index examples) {
  if (is_of_many(examples)) return halves(examples);
  const int degree = examples == 2 ? 8 : examples == 3 ? 5 : 4;
  return interpolation_nodes(runtime::BernsteinBasis(degree, static_cast<int>(examples)).exponents());
}

// Other ones, to check by: `round` counts from 0.
RowMatrix check_weights(Eigen::Index examples, int round) {
  if (!is_of_many(examples)) {
    const int count = examples == 2 ? 9 : 3;
    const RowMatrix spread = spread_points(examples, count * (round + 1));
    return spread;
  }
  RowMatrix weights(std::ssize(kCheckedTogether) * examples, examples);
  for (std::size_t i = 0; i < std::size(kCheckedTogether); ++i)
    weights.middleRows(static_cast<Eigen::Index>(i) * examples, examples) =
        some_together(examples, kCheckedTogether[i], static_cast<int>(examples),
                      static_cast<std::uint64_t>(kCheckedTogether[i] + 100 * (round + 1)));
  return weights;
}

// Orthonormal columns; those of `vectors` [d x N] first that they do not hold yet.
void append_independent(const Eigen::MatrixXd& vectors, double nothing, Eigen::MatrixXd& columns) {
  for (Eigen::VectorXd rest : vectors.colwise()) {
    for (int pass = 0; pass < 2; ++pass) rest -= columns * (columns.transpose() * rest);
    if (rest.norm() <= nothing) continue;
    columns.conservativeResize(vectors.rows(), columns.cols() + 1);
    columns.rightCols<1>() = rest.normalized();
  }
}

// The examples, then principal components of the samples, until none is farther than `distance` from its projection.
Eigen::MatrixXd principal_space(const Eigen::MatrixXd& examples, const Eigen::MatrixXd& samples, double distance,
                                double nothing) {
  Eigen::MatrixXd columns(examples.rows(), 0);
  append_independent(examples, nothing, columns);
  Eigen::MatrixXd rest = samples - columns * (columns.transpose() * samples);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> gram(Eigen::MatrixXd(rest * rest.transpose()));
  for (Eigen::Index i = gram.eigenvalues().size() - 1; i >= 0; --i) {
    if (columns.cols() > 0 && (rest.cols() == 0 || rest.colwise().norm().maxCoeff() <= distance)) break;
    append_independent(gram.eigenvectors().col(i), nothing, columns);
    rest = samples - columns * (columns.transpose() * samples);
  }
  return columns;
}

class SpaceBuilder {
 public:
  SpaceBuilder(const ObjectData& object, const ElasticSystem& system, const PoseCoordinates& range,
               const TargetSpaceOptions& options)
      : object_(object),
        system_(system),
        range_(range),
        options_(options),
        element_count_(elements_of(object.mesh, object.materials).count()),
        whole_(target_in(range)),
        count_(range.poses.cols()),
        tolerance_((is_of_many(count_) ? kManyTolerance : 1) * options.tolerance),
        enough_(kShare * tolerance_),
        examples_(whole_.solver.dimension(), count_) {
    for (Eigen::Index k = 0; k < count_; ++k) examples_.col(k) = whole_.solver.example(k);
    scale_ = examples_.colwise().norm().maxCoeff();
  }

  TargetSpace build();

 private:
  Eigen::MatrixXd solve(const RowMatrix& weights, const MinimumFinder::Starts& starts);
  PoseCoordinates coordinates() const;
  double check(int round);
  MeshTarget target_in(const PoseCoordinates& coordinates) const;
  TargetTableOptions table_options() const {
    return {.tolerance = tolerance_, .energy_reference = options_.energy_reference};
  }
  void add_table(TargetSpace& space) const;
  void add_table_of_many(TargetSpace& space, TargetTableReport& report) const;
  std::optional<TargetTableData> corrected_table(const TargetSolver& elements, const Eigen::MatrixXd& poses,
                                                 TargetTableOptions options, TargetTableReport& report) const;
  MinimumFinder::Correction correction_of(const TargetSolver& elements) const;

  const ObjectData& object_;
  const ElasticSystem& system_;
  const PoseCoordinates& range_;
  const TargetSpaceOptions& options_;
  Eigen::Index element_count_;
  MeshTarget whole_;
  Eigen::Index count_;
  double tolerance_;          // of the table
  double enough_;             // of it, that the space may take
  Eigen::MatrixXd examples_;  // d' x K, in unit coordinates of the range
  double scale_ = 0;
  Eigen::MatrixXd samples_;  // d' x N, targets
  Eigen::MatrixXd columns_;  // d' x d, orthonormal
  MeshTarget small_;         // in these
};

MeshTarget SpaceBuilder::target_in(const PoseCoordinates& coordinates) const {
  if (element_count_ <= options_.most_elements)
    return mesh_target(object_, system_, coordinates, options_.energy_reference);
  return sampled_target(object_, system_, coordinates, options_.energy_reference, options_.sample);
}

// [d' x N], those that were found.
Eigen::MatrixXd SpaceBuilder::solve(const RowMatrix& weights, const MinimumFinder::Starts& starts) {
  MinimumFinder finder(whole_.solver, kSameMinimum * tolerance_ * scale_, whole_.all.get());
  const RowMatrix minima = finder.find(weights, starts, "targets on the whole mesh");
  std::vector<Eigen::Index> found;
  for (Eigen::Index i = 0; i < minima.rows(); ++i)
    if (minima.row(i).allFinite()) found.push_back(i);
  return minima(found, Eigen::all).transpose();
}

PoseCoordinates SpaceBuilder::coordinates() const {
  return {range_.basis * (whole_.solver.basis() * columns_), columns_.transpose() * examples_};
}

// Targets of the space against those of the range, which start from them; these become samples. Largest distance over
// the largest example.
double SpaceBuilder::check(int round) {
  const RowMatrix weights = check_weights(count_, round);
  MinimumFinder finder(small_.solver, kSameMinimum * tolerance_ * scale_, small_.all.get());
  const RowMatrix inside = finder.find(weights, from_blend(small_.solver), "targets in their space");
  const Eigen::MatrixXd guesses = columns_ * (small_.solver.basis() * inside.transpose());
  const auto from_space = [&](const Eigen::VectorXd&, Eigen::Index row) {
    return std::vector<Eigen::VectorXd>{guesses.col(row)};
  };
  MinimumFinder polish(whole_.solver, kSameMinimum * tolerance_ * scale_, whole_.all.get());
  polish.starts_are_near();
  const RowMatrix minima = polish.find(weights, from_space, "targets on the whole mesh");
  double error = 0;
  std::vector<Eigen::Index> found;
  for (Eigen::Index i = 0; i < weights.rows(); ++i) {
    const double distance = (minima.row(i).transpose() - guesses.col(i)).norm();
    if (!std::isfinite(distance)) continue;
    found.push_back(i);
    error = std::max(error, distance / scale_);
  }
  const Eigen::Index before = samples_.cols();
  samples_.conservativeResize(Eigen::NoChange, before + std::ssize(found));
  samples_.rightCols(std::ssize(found)) = minima(found, Eigen::all).transpose();
  return error;
}

TargetSpace SpaceBuilder::build() {
  const double distance = enough_ * scale_;
  samples_ = Eigen::MatrixXd(examples_.rows(), 0);
  if (scale_ > 0 && count_ > 1) samples_ = solve(first_weights(count_), from_blend(whole_.solver));
  TargetSpace space;
  space.energy_reference = options_.energy_reference;
  for (int round = 0; round < kRounds; ++round) {
    columns_ = principal_space(examples_, samples_, 0.5 * distance, kNoDirection * scale_);
    space.coordinates = coordinates();
    small_ = target_in(space.coordinates);
    if (scale_ == 0 || count_ < 2) break;
    space.error = check(round);
    if (space.error <= enough_) break;
  }
  space.left_out = whole_.left_out;
  log::info(fmt::format("targets: {} displacements hold them, error {:.1e}", columns_.cols(), space.error));
  space.elements = target_elements(object_, system_, space.coordinates, small_,
                                   {options_.energy_reference, options_.element_tolerance, options_.seed});
  if (options_.table) add_table(space);
  return space;
}

// By all tets, or where they are many by way of the elements that stand for them.
void SpaceBuilder::add_table(TargetSpace& space) const {
  TargetTableReport report;
  if (small_.all)
    add_table_of_many(space, report);
  else
    space.table = build_target_table(small_.solver, space.coordinates.poses, table_options(), report);
  if (space.table) space.table->error += space.error;
  space.table_message = report.message;
}

void SpaceBuilder::add_table_of_many(TargetSpace& space, TargetTableReport& report) const {
  TargetSolver elements;
  const Eigen::MatrixXd& poses = space.coordinates.poses;
  const auto complaint = elements.build(object_.materials.model, space.elements, examples_at(poses),
                                        RowMatrix::Identity(poses.rows(), poses.rows()), options_.energy_reference);
  const bool accurate = !complaint && space.elements.heldout_error <= options_.element_tolerance;
  TargetTableOptions options = table_options();
  // The elements say whether any table is accurate enough, and of which degree.
  if (accurate && !build_target_table(elements, poses, options, report)) return;
  options.all = small_.all.get();
  options.first_degree = accurate && report.pieces == 1 ? report.degree : options.first_degree;
  if (accurate && report.pieces == 1 && !is_of_many(count_))
    space.table = corrected_table(elements, poses, options, report);
  if (!space.table) space.table = build_target_table(accurate ? elements : small_.solver, poses, options, report);
}

// The elements' error changes slowly with the weights: few targets of all tets correct theirs, and others say
// how far the table is from all tets. None where that is too far.
std::optional<TargetTableData> SpaceBuilder::corrected_table(const TargetSolver& elements, const Eigen::MatrixXd& poses,
                                                             TargetTableOptions options,
                                                             TargetTableReport& report) const {
  options.all = nullptr;
  options.correction = correction_of(elements);
  auto table = build_target_table(elements, poses, options, report);
  if (!table) return std::nullopt;
  const TableError meter(elements, count_);
  MinimumFinder finder(elements, kSameMinimum * options.tolerance * meter.scale(), small_.all.get());
  const RowMatrix weights = spread_points(count_, kTableChecks);
  const RowMatrix exact = finder.find(weights, from_blend(elements), "targets to check the table by");
  const double error = meter.errors(runtime::TargetTable(*table), {weights, exact}).maxCoeff();
  if (!(error <= options.tolerance)) return std::nullopt;
  table->error = std::max(table->error, error);
  report.message += fmt::format(", {:.2g} from all tets", error);
  return table;
}

// From the elements' targets to those of all tets, as a polynomial of the weights.
MinimumFinder::Correction SpaceBuilder::correction_of(const TargetSolver& elements) const {
  const runtime::BernsteinBasis basis(count_ == 2 ? 14 : count_ == 3 ? 8 : 5, static_cast<int>(count_));
  const RowMatrix weights = interpolation_nodes(basis.exponents());
  const double same = kSameMinimum * tolerance_ * scale_;
  MinimumFinder of_elements(elements, same), of_all(elements, same, small_.all.get());
  const RowMatrix rough = of_elements.find(weights, from_blend(elements), "targets of the elements"),
                  exact = of_all.find(weights, from_blend(elements), "targets of all tets");
  const Eigen::MatrixXd coefficients = collocation(basis, weights).partialPivLu().solve(Eigen::MatrixXd(exact - rough));
  return [basis, coefficients](const Eigen::VectorXd& w) -> Eigen::VectorXd {
    return (collocation(basis, w.transpose()) * coefficients).transpose();
  };
}

}  // namespace

TargetSpace build_target_space(const ObjectData& object, const ElasticSystem& system, const PoseCoordinates& range,
                               const TargetSpaceOptions& options) {
  return SpaceBuilder(object, system, range, options).build();
}

void finish_targets(const TargetSpace& space, const Eigen::MatrixXd& pull, std::optional<TargetSpaceData>& data,
                    std::optional<TargetTableData>& table) {
  data.emplace();
  data->energy_reference = space.energy_reference;
  data->error = space.error;
  data->element_error = space.elements.heldout_error;
  data->poses = space.coordinates.poses.transpose();
  data->pull = pull;
  data->elements = space.elements.elements;
  data->weights = space.elements.weights;
  data->volumes = space.elements.volumes;
  data->gradient = space.elements.gradient;
  data->youngs_modulus = space.elements.youngs_modulus;
  data->poisson_ratio = space.elements.poisson_ratio;
  table = space.table;
  if (!table) return;
  table->is_pull = true;
  table->control_points = space.table->control_points * pull.transpose();
}

}  // namespace exmat::precompute
