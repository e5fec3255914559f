#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "precompute/full_space/full_space_model.h"
#include "precompute/training/training_segments.h"

namespace exmat::precompute {

struct TrainingRunOptions {
  double angular_frequency = 0;  ///< omega_1 [rad/s]: the time step and the damping follow it
  std::optional<double> mass_damping{}, stiffness_damping{};  ///< absent: none, and 0.03 / omega_1
  double budget = 0;                                          ///< [s]; no segment begins after it; 0: none
  bool positions = false;  ///< keep deformations and positions of all vertices, to compare with
};

/// Deformations of the body in runs with all its degrees of freedom.
struct TrainingRuns {
  Eigen::MatrixXd snapshots;  ///< f x N, of a free body in the frame that fits it best
  std::int64_t segments = 0;  ///< that were run
  std::int64_t skipped = 0;   ///< that the budget left no time for, or that did not stay finite
  std::int64_t steps = 0;
  std::vector<std::int64_t> chain_ends;  ///< columns that end the chains
  Eigen::MatrixXd deformations;          ///< 3n x N, where positions are kept
  Eigen::MatrixXd displacements;         ///< 3n x N, likewise: from rest, world
};

/// Members that the stage cache keeps.
template <typename Archive>
void pass_members(Archive& archive, TrainingRuns& value) {
  pass_all(archive, value.snapshots, value.segments, value.skipped, value.steps, value.chain_ends, value.deformations,
           value.displacements);
}

constexpr int kStepsPerSnapshot = 2;

double time_step_of(const TrainingRunOptions& options);          ///< [s]
double stiffness_damping_of(const TrainingRunOptions& options);  ///< beta [s]
std::int64_t steps_of(const Segment& segment, const TrainingRunOptions& options);
std::int64_t step_count(const std::vector<Chain>& chains, const TrainingRunOptions& options);  ///< total

/// Runs chains of segments side by side. Without a budget the same in every run and for every number of threads.
TrainingRuns run_segments(const FullSpaceModel& model, const std::vector<Chain>& chains,
                          const TrainingRunOptions& options);

}  // namespace exmat::precompute
