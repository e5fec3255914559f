#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/core/atomic_file.h"
#include "common/hdf5/hdf5_file.h"
#include "precompute/study/measure/inverted_tets.h"
#include "precompute/study/measure/runs.h"
#include "runtime/output/trajectory_rows.h"

namespace exmat::precompute {

/// Writes the motion of a body in full space as the run time writes a trajectory, and an .xdmf beside it:
/// docs/bundle_format.md, "Trajectory", without the reduced coordinates. All appear under their names in finish() and
/// not before; without it nothing is left.
class FullSpaceTrajectory {
 public:
  /// Opens the file for a body of `data`, whose names and mesh it takes; both outlive the writer. `frames` will be
  /// appended. Throws WorkError.
  FullSpaceTrajectory(const std::filesystem::path& file, const SceneConfig& config, const ReducedModel& data,
                      const FullSpaceRun& body, std::int64_t frames);
  ~FullSpaceTrajectory();

  /// The body as it is now. `step_seconds`: wall-clock time of the step that led to it.
  void append(double step_seconds);

  /// To be called after the last frame. Throws WorkError.
  void finish();

  const InvertedTets& inverted() const { return inverted_; }

 private:
  void append_motion(const VertexArray& positions);

  const ReducedModel& data_;
  const FullSpaceRun& body_;
  AtomicFile output_;
  std::vector<runtime::WeightInfo> weights_;
  Hdf5File file_;
  std::unique_ptr<runtime::TrajectoryRows> datasets_;
  SparseMatrix mass_;  // n x n
  std::vector<double> times_;
  Eigen::Vector3d origin_ = Eigen::Vector3d::Zero();  ///< that positions are measured from [m]
  InvertedTets inverted_;
};

/// Results of a run in full space.
struct FullSpaceSummary {
  std::int64_t steps = 0, frames = 0, unconverged = 0;
  double step_seconds = 0, newton_iterations = 0;  ///< median, mean
  runtime::Energies energies;                      ///< at the end
  InvertedTets inverted;                           ///< inverted tets of the frames
};

/// Steps a scene in full space, config.steps of them, and writes every config.every-th
/// frame. Reads its whole bundle. Throws InputError: a bundle that lacks a group, a scene that the full space cannot
/// run; WorkError at a number that is not finite, or where the file cannot be written.
FullSpaceSummary write_full_space(const SceneConfig& config, const std::filesystem::path& file);

}  // namespace exmat::precompute
