#include "precompute/alignment/registration.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "common/mesh/geometry.h"
#include "precompute/alignment/surface_smoothing.h"

namespace exmat::precompute {
namespace {

constexpr int kRounds = 25, kOpeningRounds = 8, kRefiningRounds = 8, kRelaxingRounds = 8;
constexpr int kStepsPerRound = 2;  // local and global
constexpr double kFirstWeight = 20, kLastWeight = 400;
constexpr double kLastWeightOfSteps = 80;  // of a staircase
// Over the two-way Chamfer squared, which surfaces that agree have: the weight that a relaxed body has.
constexpr double kAgreement = 1e-3, kLeastWeight = 4, kNoChamfer = 1e-12;
constexpr double kMostApart = 5;    // times that Chamfer squared: beyond, the pose is taken back rather
constexpr double kPairWeight = 20;  // of pairs given, whatever the round
constexpr Eigen::Index kCornersOfATet = 4;
constexpr double kPointToPoint = 0.1;    // beside point-to-plane
constexpr int kFactors = 4;              // weights between the first and the last that are factored
constexpr double kIsotropicShare = 0.4;  // of the preconditioner, between kPointToPoint and 1 + kPointToPoint
constexpr double kTolerance = 1e-5;      // of conjugate gradients, on the residual
constexpr int kMostIterations = 60;

double factored_weight(int factor) {
  return kFirstWeight * std::pow(kLastWeight / kFirstWeight, factor / static_cast<double>(kFactors - 1));
}

double last_weight(const TetMesh& moving, const TetMesh& fixed) {
  const bool steps = is_staircase(moving.vertices, surface_triangles(moving.tets)) ||
                     is_staircase(fixed.vertices, surface_triangles(fixed.tets));
  return steps ? kLastWeightOfSteps : kLastWeight;
}

SurfaceTree smoothed_surface(const TetMesh& mesh) {
  const TriangleArray triangles = surface_triangles(mesh.tets);
  return {surface_smoothing(mesh.vertices, triangles) * mesh.vertices, triangles};
}

}  // namespace

// A point of a moving triangle and the plane that it belongs on.
struct Registration::SurfacePair {
  std::array<std::int32_t, 3> corners{};
  Eigen::Vector3d weights;
  Eigen::Vector3d target, normal;
  double share = 0;  // of all pairs

  Eigen::Vector3d pull(const Eigen::Vector3d& distance) const {
    return share * (normal * normal.dot(distance) + kPointToPoint * distance);
  }
  Eigen::Vector3d point(const VertexArray& positions) const {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (int k = 0; k < 3; ++k) sum += weights[k] * positions.row(corners[static_cast<std::size_t>(k)]).transpose();
    return sum;
  }
  void add(const Eigen::Vector3d& force, VertexArray& forces) const {
    for (int k = 0; k < 3; ++k) forces.row(corners[static_cast<std::size_t>(k)]) += weights[k] * force.transpose();
  }
};

Registration::Registration(const TetMesh& moving, const TetMesh& fixed, PointPairs pairs)
    : arap_(moving),
      triangles_(surface_triangles(moving.tets)),
      areas_(triangle_samples(moving.vertices, triangles_).areas),
      smoothing_(surface_smoothing(moving.vertices, triangles_)),
      fixed_(smoothed_surface(fixed)),
      last_weight_(last_weight(moving, fixed)),
      pairs_(std::move(pairs)) {
  areas_ /= areas_.sum();
  std::vector<Eigen::Triplet<double>> entries;
  for (Eigen::Index k = 0; k < triangles_.rows(); ++k)
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) entries.emplace_back(triangles_(k, i), triangles_(k, j), areas_[k] / 9);
  const Eigen::Index n = arap_.stiffness().rows();
  Eigen::SparseMatrix<double> surface(n, n);
  surface.setFromTriplets(entries.begin(), entries.end());
  Eigen::SparseMatrix<double> base = arap_.stiffness();
  // Points between many vertices would fill the matrix; they are few, which conjugate gradients manage.
  if (pairs_.count() > 0 && pairs_.points.nonZeros() <= kCornersOfATet * pairs_.count())
    base += Eigen::SparseMatrix<double>(pairs_.points.transpose() * pairs_.points) *
            (kPairWeight / static_cast<double>(pairs_.count()));
  for (int factor = 0; factor < kFactors; ++factor)
    factors_.emplace_back(base + kIsotropicShare * factored_weight(factor) * surface, "registration: global step");
}

const CholeskyFactor& Registration::preconditioner(double weight) const {
  const double step = std::log(kLastWeight / kFirstWeight) / (kFactors - 1);
  const auto index = std::max(0L, std::lround(std::log(weight / kFirstWeight) / step));
  return factors_[static_cast<std::size_t>(index)];
}

std::vector<Registration::SurfacePair> Registration::surface_pairs(const VertexArray& positions) const {
  const SurfaceTree moved = moved_surface(positions);
  const auto& ours = moved.samples();
  const auto& theirs = fixed_.samples();
  const Eigen::Index forward = triangles_.rows(), count = forward + theirs.areas.size();
  const double their_area = theirs.areas.sum();
  std::vector<SurfacePair> pairs(static_cast<std::size_t>(count));
#pragma omp parallel for schedule(static)
  for (Eigen::Index k = 0; k < count; ++k) {
    SurfacePair& pair = pairs[static_cast<std::size_t>(k)];
    Eigen::Index triangle = k;
    if (k < forward) {
      const auto found = fixed_.nearest_facing(ours.centres.row(k).transpose(), ours.normals.row(k).transpose());
      pair.weights.setConstant(1.0 / 3);
      pair.target = found.position;
      pair.normal = theirs.normals.row(found.triangle);
      pair.share = 0.5 * areas_[k];
    } else {
      const Eigen::Index sample = k - forward;
      pair.target = theirs.centres.row(sample);
      pair.normal = theirs.normals.row(sample);
      const auto found = moved.nearest_facing(pair.target, pair.normal);
      pair.weights = found.weights;
      pair.share = 0.5 * theirs.areas[sample] / their_area;
      triangle = found.triangle;
    }
    for (int corner = 0; corner < 3; ++corner)
      pair.corners[static_cast<std::size_t>(corner)] = triangles_(triangle, corner);
  }
  return pairs;
}

void Registration::round(double weight, VertexArray& positions) const {
  const auto pairs = surface_pairs(positions);
  const double pair_weight = pairs_.count() > 0 ? kPairWeight / static_cast<double>(pairs_.count()) : 0;
  const auto apply = [&](const VertexArray& x) {
    const VertexArray smooth = smoothing_ * x;
    VertexArray pulls = VertexArray::Zero(x.rows(), 3);
    for (const auto& pair : pairs) pair.add(weight * pair.pull(pair.point(smooth)), pulls);
    VertexArray y = smoothing_.transpose() * pulls;
    y += arap_.stiffness() * x;
    if (pair_weight > 0) y += pairs_.points.transpose() * (pair_weight * (pairs_.points * x));
    return y;
  };
  VertexArray targets = VertexArray::Zero(positions.rows(), 3);
  for (const auto& pair : pairs) pair.add(weight * pair.pull(pair.target), targets);
  targets = smoothing_.transpose() * targets;
  if (pair_weight > 0) targets += pairs_.points.transpose() * (pair_weight * pairs_.targets);
  const CholeskyFactor& factor = preconditioner(weight);
  for (int step = 0; step < kStepsPerRound; ++step) {
    const VertexArray load = arap_.load(arap_.rotations(positions)) + targets;
    VertexArray residual = load - apply(positions);
    VertexArray preconditioned = factor.solve(residual);
    VertexArray direction = preconditioned;
    double product = residual.cwiseProduct(preconditioned).sum();
    for (int k = 0; k < kMostIterations && residual.norm() > kTolerance * load.norm(); ++k) {
      const VertexArray applied = apply(direction);
      const double length = product / direction.cwiseProduct(applied).sum();
      positions += length * direction;
      residual -= length * applied;
      preconditioned = factor.solve(residual);
      const double next = residual.cwiseProduct(preconditioned).sum();
      direction = preconditioned + next / product * direction;
      product = next;
    }
  }
}

void Registration::rounds(int first, int end, VertexArray& positions) const {
  for (int k = first; k < end; ++k)
    round(kFirstWeight * std::pow(last_weight_ / kFirstWeight, k / (kRounds - 1.0)), positions);
}

Registered Registration::begin(const VertexArray& start) const {
  VertexArray positions = start;
  rounds(0, kOpeningRounds, positions);
  return assess(positions);
}

Registered Registration::finish(const VertexArray& begun) const {
  VertexArray positions = begun;
  rounds(kOpeningRounds, kRounds, positions);
  return assess(positions);
}

Registered Registration::run(const VertexArray& start) const {
  VertexArray positions = start;
  rounds(0, kRounds, positions);
  return assess(positions);
}

Registered Registration::refine(const VertexArray& start) const {
  VertexArray positions = start;
  for (int k = 0; k < kRefiningRounds; ++k) round(last_weight_, positions);
  return assess(positions);
}

VertexArray Registration::relaxed(const Registered& registered) const {
  const double last = std::clamp(kAgreement / std::max(registered.chamfer, kNoChamfer), kLeastWeight, last_weight_);
  VertexArray positions = registered.positions, next = positions;
  for (int k = 1; k <= kRelaxingRounds; ++k) {
    round(last_weight_ * std::pow(last / last_weight_, k / static_cast<double>(kRelaxingRounds)), next);
    if (two_way_chamfer(moved_surface(next), fixed_) > kMostApart * registered.chamfer + kNoChamfer) break;
    positions = next;
  }
  return positions;
}

Registered Registration::assess(const VertexArray& positions) const {
  Registered result;
  result.positions = positions;
  result.distortion = arap_.energy(positions);
  result.chamfer = two_way_chamfer(moved_surface(positions), fixed_);
  result.inverted = arap_.inverted_fraction(positions);
  if (pairs_.count() > 0)
    result.landmark_rms =
        (pairs_.points * positions - pairs_.targets).norm() / std::sqrt(static_cast<double>(pairs_.count()));
  return result;
}

}  // namespace exmat::precompute
