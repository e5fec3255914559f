#include "precompute/study/measure/error_metrics.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "precompute/shape_space/transfer.h"
#include "precompute/study/measure/nearest_phase.h"

namespace exmat::precompute {
namespace {

// Motions below this share of the body's own size are what steps that are solved to 1e-8 of the forces leave.
constexpr double kNothing = 1e-9;

constexpr double kSettledFrom = 0.9 * (1 - 1e-9);  // of the time, and rounding

double root_mean_square(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value * value;
  return std::sqrt(sum / static_cast<double>(values.size()));
}

double relative(double distance, double size, double nothing) {
  if (size > nothing) return distance / size;
  return distance <= nothing ? 0 : std::numeric_limits<double>::infinity();
}

// The frames of the last tenth of the time, of which the last is always one.
std::vector<double> settled(const std::vector<double>& distances, const std::vector<double>& times) {
  std::vector<double> found;
  for (std::size_t i = 0; i < times.size(); ++i)
    if (times[i] >= kSettledFrom * times.back()) found.push_back(distances[i]);
  return found;
}

RelativeError relative(const std::vector<double>& distances, double size, double nothing,
                       const std::vector<double>& times) {
  const auto share = [&](double distance) { return relative(distance, size, nothing); };
  return {share(root_mean_square(distances)), share(*std::ranges::max_element(distances)), share(distances.back()),
          share(root_mean_square(settled(distances, times)))};
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

// Distances of each frame, and their size.
struct Distances {
  std::vector<double> values, sizes;

  RelativeError relative_error(double nothing, const std::vector<double>& times) const {
    return relative(values, root_mean_square(sizes), nothing, times);
  }
};

Distances positions_apart(const BodyFrames& frames, const BodyFrames& reference, const VertexArray& rest,
                          const SparseMatrix& mass) {
  Distances apart;
  for (std::size_t i = 0; i < reference.times.size(); ++i) {
    apart.values.push_back(mass_norm(mass, frames.positions[i] - reference.positions[i]));
    apart.sizes.push_back(mass_norm(mass, reference.positions[i] - rest));
  }
  return apart;
}

Distances velocities_apart(const BodyFrames& frames, const BodyFrames& reference, const SparseMatrix& mass) {
  Distances apart;
  for (std::size_t i = 0; i < reference.times.size(); ++i) {
    apart.values.push_back(mass_norm(mass, frames.velocities[i] - reference.velocities[i]));
    apart.sizes.push_back(mass_norm(mass, reference.velocities[i]));
  }
  return apart;
}

Distances shapes_apart(const BodyFrames& frames, const BodyFrames& reference, const VertexArray& rest,
                       const SparseMatrix& mass) {
  Distances apart;
  for (std::size_t i = 0; i < reference.times.size(); ++i) {
    const VertexArray& there = reference.positions[i];
    apart.values.push_back(mass_norm(mass, fitted(mass, frames.positions[i], there) - there));
    apart.sizes.push_back(mass_norm(mass, fitted(mass, rest, there) - there));
  }
  return apart;
}

// Never more than at the same time, where it is rounding that says so.
Distances at_nearest_phase(const Distances& apart, const BodyFrames& frames, const BodyFrames& reference,
                           const SparseMatrix& mass, bool free_body) {
  Distances nearest = apart;
  const auto found = nearest_distances(frames, reference, mass, kPhaseReach * reference.times.back(), free_body);
  for (std::size_t i = 0; i < found.size(); ++i) nearest.values[i] = std::min(apart.values[i], found[i]);
  return nearest;
}

}  // namespace

RelativeError headline_distance(const BodyFrames& frames, const BodyFrames& other, const BodyFrames& sized_by,
                                const VertexArray& rest, const SparseMatrix& mass, bool free_body) {
  const auto apart = free_body ? shapes_apart : positions_apart;
  Distances distances = apart(frames, other, rest, mass);
  distances.sizes = apart(sized_by, sized_by, rest, mass).sizes;
  return distances.relative_error(kNothing * mass_norm(mass, rest.rowwise() - centre(mass, rest)), other.times);
}

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
  const std::vector<double>& times = reference.times;
  const Distances positions = positions_apart(frames, reference, rest, mass);
  const Distances headline = free_body ? shapes_apart(frames, reference, rest, mass) : positions;
  TrajectoryErrors errors;
  errors.position = positions.relative_error(nothing, times);
  errors.velocity = velocities_apart(frames, reference, mass).relative_error(nothing_moves, times);
  errors.energy = energy_error(frames, reference, nothing_moves * nothing_moves);
  if (free_body) errors.shape = headline.relative_error(nothing, times);
  errors.nearest_phase = at_nearest_phase(headline, frames, reference, mass, free_body).relative_error(nothing, times);
  errors.rebound = rebound_error(frames.rebound, reference.rebound);
  errors.worst_frame = static_cast<std::size_t>(std::ranges::max_element(headline.values) - headline.values.begin());
  return errors;
}

}  // namespace exmat::precompute
