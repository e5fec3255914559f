#include "precompute/cubature/training_poses.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>
#include <utility>
#include <vector>

#include "common/core/decompositions.h"

namespace exmat::precompute {
namespace {

constexpr double kLargestDisplacement = 0.4;  // of L
constexpr double kSmallestShare = 0.05;       // of that
constexpr double kNoiseEnergy = 0.01;
constexpr double kLeastMotion = 0.01;                          // of the largest
constexpr double kAtRest = 1e-12;                              // of the largest: own motions below that are none
constexpr Eigen::Index kExampleStride = 4;                     // every fourth pose is an example's
constexpr Eigen::Index kMotionCycle = 8, kMotionsOfCycle = 6;  // poses of motions, where there are any

class PoseGenerator {
 public:
  PoseGenerator(const PoseSource& source, std::uint64_t seed)
      : source_(source), generator_(seed), stiffness_factor_(source.rest_stiffness) {}

  // The work left on a pose once its random numbers are drawn.
  using Rest = std::function<Eigen::VectorXd()>;

  Rest on_manifold() {
    const Eigen::Index k = source_.eigenvalues.size();
    Eigen::VectorXd z(k);
    for (Eigen::Index i = 0; i < k; ++i) z[i] = normal_(generator_) * source_.eigenvalues[0] / source_.eigenvalues[i];
    const double share = kSmallestShare + (1 - kSmallestShare) * uniform_(generator_);
    return [this, z, share, noise = noise()] { return with_noise(manifold_point(z, share), noise); };
  }

  // Not one at rest, whose forces say nothing.
  Rest of_motion(const Eigen::MatrixXd& motions, Eigen::Index own) {
    const Eigen::Index count = own > 0 && uniform_(generator_) < 0.5 ? own : motions.cols();
    std::uniform_int_distribution<Eigen::Index> any(0, count - 1);
    const double least = kLeastMotion * motions.leftCols(count).colwise().norm().maxCoeff();
    Eigen::Index column = any(generator_);
    while (motions.col(column).norm() < least) column = any(generator_);
    return [this, pose = Eigen::VectorXd(motions.col(column)), noise = noise()] { return with_noise(pose, noise); };
  }

  Rest on_segment() {
    const Eigen::Index count = source_.examples.cols();
    std::uniform_int_distribution<Eigen::Index> any(0, count);  // `count` stands for the rest pose
    const Eigen::Index from = any(generator_);
    const Eigen::Index to =
        (from + 1 + std::uniform_int_distribution<Eigen::Index>(0, count - 1)(generator_)) % (count + 1);
    const double t = uniform_(generator_);
    const Eigen::VectorXd pose = (1 - t) * example(from) + t * example(to);
    return [this, pose, noise = noise()] { return with_noise(pose, noise); };
  }

 private:
  Eigen::VectorXd manifold_point(const Eigen::VectorXd& z, double share) const {
    const Eigen::Index k = z.size();
    const Eigen::VectorXd linear = source_.reduced_modes * z;
    Eigen::VectorXd quadratic = Eigen::VectorXd::Zero(linear.size());
    for (Eigen::Index j = 0; j < k; ++j)
      for (Eigen::Index i = 0; i <= j; ++i)
        quadratic += (i == j ? 0.5 : 1.0) * z[i] * z[j] * source_.reduced_derivatives.col(pair_index(i, j));
    const double scale = scale_to(linear, quadratic, share * kLargestDisplacement * source_.body_size);
    return scale * linear + scale * scale * quadratic;
  }

  Eigen::VectorXd example(Eigen::Index index) const {
    if (index == source_.examples.cols()) return Eigen::VectorXd::Zero(source_.examples.rows());
    return source_.examples.col(index);
  }

  // s such that the largest displacement of s a + s^2 b is `target`, by bisection of a bracket.
  double scale_to(const Eigen::VectorXd& linear, const Eigen::VectorXd& quadratic, double target) const {
    const auto field = [this](const Eigen::VectorXd& q) -> VertexArray {
      return (source_.basis * q).reshaped<Eigen::RowMajor>(source_.basis.rows() / 3, 3);
    };
    const VertexArray a = field(linear), b = field(quadratic);
    const Eigen::ArrayXd aa = a.rowwise().squaredNorm(), ab = 2 * a.cwiseProduct(b).rowwise().sum(),
                         bb = b.rowwise().squaredNorm();
    const auto largest = [&](double s) { return s * std::sqrt((aa + s * (ab + s * bb)).maxCoeff()); };
    double low = 0, high = target / std::sqrt(aa.maxCoeff());
    while (largest(high) < target) high *= 2;
    for (int round = 0; round < 40; ++round) {
      const double middle = 0.5 * (low + high);
      (largest(middle) < target ? low : high) = middle;
    }
    return high;
  }

  Eigen::VectorXd noise() {
    Eigen::VectorXd noise(source_.rest_stiffness.rows());
    for (double& entry : noise) entry = normal_(generator_);
    return noise;
  }

  Eigen::VectorXd with_noise(const Eigen::VectorXd& pose, Eigen::VectorXd noise) const {
    stiffness_factor_.matrixU().solveInPlace(noise);  // now noise^T K noise = |raw noise|^2
    const double energy = pose.dot(source_.rest_stiffness * pose), raw = noise.dot(source_.rest_stiffness * noise);
    return pose + std::sqrt(kNoiseEnergy * energy / raw) * noise;
  }

  const PoseSource& source_;
  std::mt19937_64 generator_;
  std::normal_distribution<double> normal_;
  std::uniform_real_distribution<double> uniform_;
  Eigen::LLT<Eigen::MatrixXd> stiffness_factor_;
};

}  // namespace

PoseSource pose_source(const ElasticSystem& system, const LinearModes& modes, const Eigen::MatrixXd& derivatives,
                       const Eigen::MatrixXd& free_basis, double body_size, const Eigen::MatrixXd& examples) {
  const Eigen::Index k = std::min<Eigen::Index>(kTrainingModes, modes.eigenvalues.size());
  const Eigen::MatrixXd mass_basis = system.mass * free_basis;
  return {modes.eigenvalues.head(k),
          mass_basis.transpose() * modes.modes.leftCols(k),
          mass_basis.transpose() * derivatives.leftCols(k * (k + 1) / 2),
          system.extend(free_basis),
          free_basis.transpose() * (system.stiffness * free_basis),
          body_size,
          examples,
          {},
          0,
          {}};
}

void set_motions(const Eigen::MatrixXd& motions, Eigen::Index own, const Eigen::MatrixXd& others,
                 const ElasticSystem& system, const Eigen::MatrixXd& free_basis, PoseSource& source) {
  source.own_motions = own;
  const Eigen::MatrixXd mass_basis = system.mass * free_basis;
  source.motions = mass_basis.transpose() * motions;
  source.other_motions = mass_basis.transpose() * others;
}

namespace {

double largest_norm(const Eigen::MatrixXd& motions) {
  return motions.cols() > 0 ? motions.colwise().norm().maxCoeff() : 0;
}

RowMatrix draw(const PoseSource& source, const Eigen::MatrixXd& motions, Eigen::Index own, Eigen::Index count,
               std::uint64_t seed) {
  PoseGenerator generator(source, seed);
  std::vector<PoseGenerator::Rest> drawn;
  const bool has_examples = source.examples.cols() > 0;
  const double largest = largest_norm(motions);
  if (!(largest_norm(motions.leftCols(own)) > kAtRest * largest)) own = 0;
  for (Eigen::Index i = 0; i < count; ++i) {
    if (largest > 0 && i % kMotionCycle < kMotionsOfCycle)
      drawn.push_back(generator.of_motion(motions, own));
    else
      drawn.push_back(has_examples && i % kExampleStride == kExampleStride - 1 ? generator.on_segment()
                                                                               : generator.on_manifold());
  }
  RowMatrix poses(count, source.rest_stiffness.rows());
#pragma omp parallel for schedule(dynamic)
  for (Eigen::Index i = 0; i < count; ++i) poses.row(i) = drawn[static_cast<std::size_t>(i)]().transpose();
  return poses;
}

}  // namespace

RowMatrix draw_poses(const PoseSource& source, Eigen::Index count, std::uint64_t seed) {
  return draw(source, source.motions, source.own_motions, count, seed);
}

RowMatrix draw_heldout_poses(const PoseSource& source, Eigen::Index count, std::uint64_t seed) {
  return draw(source, source.other_motions, 0, count, seed);
}

}  // namespace exmat::precompute
