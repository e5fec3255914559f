#include "precompute/study/measure/error_metrics.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "precompute/shape_space/transfer.h"

namespace exmat::precompute {
namespace {

// Motions below this share of the body's own size are rounding.
constexpr double kNothing = 1e-12;

double root_mean_square(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value * value;
  return std::sqrt(sum / static_cast<double>(values.size()));
}

double relative(double distance, double size, double nothing) {
  if (size > nothing) return distance / size;
  return distance <= nothing ? 0 : std::numeric_limits<double>::infinity();
}

RelativeError relative(const std::vector<double>& distances, const std::vector<double>& sizes, double nothing) {
  const double size = root_mean_square(sizes);
  return {relative(root_mean_square(distances), size, nothing),
          relative(*std::ranges::max_element(distances), size, nothing), relative(distances.back(), size, nothing)};
}

Eigen::RowVector3d centre(const SparseMatrix& mass, const VertexArray& positions) {
  const Eigen::VectorXd weights = mass * Eigen::VectorXd::Ones(mass.cols());
  return weights.transpose() * positions / weights.sum();
}

double total(const BodyFrames& frames, std::size_t i) {
  return frames.kinetic[i] + frames.elastic[i] + frames.potential[i];
}

double energy_error(const BodyFrames& frames, const BodyFrames& reference, double nothing) {
  double difference = 0, size = 0;
  for (std::size_t i = 0; i < reference.times.size(); ++i) {
    difference = std::max(difference, std::abs(total(frames, i) - total(reference, i)));
    size = std::max(size, reference.kinetic[i] + reference.elastic[i]);
  }
  return relative(difference, size, nothing);
}

RelativeError shape_error(const BodyFrames& frames, const BodyFrames& reference, const VertexArray& rest,
                          const SparseMatrix& mass, double nothing) {
  std::vector<double> distances, sizes;
  for (std::size_t i = 0; i < reference.times.size(); ++i) {
    const VertexArray& there = reference.positions[i];
    distances.push_back(mass_norm(mass, fitted(mass, frames.positions[i], there) - there));
    sizes.push_back(mass_norm(mass, fitted(mass, rest, there) - there));
  }
  return relative(distances, sizes, nothing);
}

}  // namespace

double mass_norm(const SparseMatrix& mass, const VertexArray& field) {
  const VertexArray product = mass * field;
  return std::sqrt(std::max(0.0, product.cwiseProduct(field).sum()));
}

VertexArray fitted(const SparseMatrix& mass, const VertexArray& moved, const VertexArray& fixed) {
  const Eigen::RowVector3d from = centre(mass, moved), to = centre(mass, fixed);
  const VertexArray arms = moved.rowwise() - from, targets = fixed.rowwise() - to;
  const VertexArray weighted = mass * arms;
  const Eigen::Matrix3d rotation = procrustes_rotation(targets.transpose() * weighted);
  return (arms * rotation.transpose()).rowwise() + to;
}

TrajectoryErrors trajectory_errors(const BodyFrames& frames, const BodyFrames& reference, const VertexArray& rest,
                                   const SparseMatrix& mass, bool free_body) {
  const double size = mass_norm(mass, rest.rowwise() - centre(mass, rest));
  const double nothing = kNothing * size, nothing_moves = nothing / reference.times.back();
  std::vector<double> distances, displacements, velocity_distances, velocities;
  for (std::size_t i = 0; i < reference.times.size(); ++i) {
    distances.push_back(mass_norm(mass, frames.positions[i] - reference.positions[i]));
    displacements.push_back(mass_norm(mass, reference.positions[i] - rest));
    velocity_distances.push_back(mass_norm(mass, frames.velocities[i] - reference.velocities[i]));
    velocities.push_back(mass_norm(mass, reference.velocities[i]));
  }
  TrajectoryErrors errors;
  errors.position = relative(distances, displacements, nothing);
  errors.velocity = relative(velocity_distances, velocities, nothing_moves);
  errors.energy = energy_error(frames, reference, nothing_moves * nothing_moves);
  if (free_body) errors.shape = shape_error(frames, reference, rest, mass, nothing);
  errors.worst_frame = static_cast<std::size_t>(std::ranges::max_element(distances) - distances.begin());
  return errors;
}

}  // namespace exmat::precompute
