#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/core/atomic_file.h"
#include "common/hdf5/hdf5_file.h"
#include "common/hdf5/xdmf.h"
#include "common/model/reduced_model.h"
#include "runtime/output/trajectory_rows.h"
#include "runtime/sim/space/full/full_body.h"
#include "runtime/sim/step/stepper.h"

namespace exmat::runtime {

/// Attributes of a run in its trajectory.
struct TrajectoryInfo {
  std::string integrator;
  std::string bundle;       ///< path from the folder of the trajectory
  double time_step = 0;     ///< [s]
  std::int64_t frames = 0;  ///< that will be appended
  std::vector<WeightInfo> weights{};
  std::int64_t attachments = 0;  ///< that hold the body
};

/// A body whose frames a trajectory holds.
struct NamedBody {
  std::string name;           ///< name of its group; empty: it is the only one, at the root
  const ReducedModel& model;  ///< holds /object and the basis, perhaps /render
  const BodyFrame& frame;
  TrajectoryInfo info;
  const FullModel* full = nullptr;  ///< present for a body that may step in full space
};

/// The frames of one body in an open file, below a group: "" for the root, or "/bodies/NAME".
class BodyFrames {
 public:
  /// The file and all that `body` refers to outlive the writer, and so does the `origin` of positions, which the first
  /// frame of any body sets for all. Throws WorkError.
  BodyFrames(Hdf5File& file, std::string group, const NamedBody& body, std::optional<Eigen::Vector3d>& origin);
  ~BodyFrames();

  /// The next frame. `step_seconds`: wall-clock time of the step that led to it. Throws WorkError, also where positions
  /// are beyond single precision.
  void append(const State& state, const Energies& energies, double step_seconds);

  /// To be called after the last frame. Throws WorkError.
  void finish();

  /// Cells that an .xdmf shows of it: the tets, or the render mesh.
  XdmfCells cells() const;
  std::optional<XdmfCells> render_cells() const;

  /// Times of the frames so far [s].
  const std::vector<double>& times() const { return times_; }
  /// Largest displacement of a vertex in the frames so far [m].
  double largest_displacement() const { return largest_displacement_; }

 private:
  std::string owner() const { return group_.empty() ? "/" : group_; }  ///< of the attributes of the run
  void append_positions(const State& state);
  void set_positions(const State& state, VertexArray& positions);
  void append_render_mesh(const VertexArray& positions);

  const ReducedModel& model_;
  const BodyFrame& frame_;
  const FullModel* full_;
  TrajectoryInfo info_;
  Hdf5File& file_;
  std::optional<Eigen::Vector3d>& origin_;
  std::string group_, tets_, vertices_, render_triangles_, render_vertices_;  // paths
  std::unique_ptr<TrajectoryRows> datasets_;
  Eigen::VectorXd rest_masses_;             ///< n_t
  VertexArray displacements_, velocities_;  ///< n x 3
  std::vector<double> times_;
  std::int64_t full_frames_ = 0;  ///< in which the body was in full space
  double largest_displacement_ = 0;
};

/// Writes a trajectory: a group /bodies/NAME for each body, or the root of one without a name. Beside it an .xdmf of
/// all of them, and NAME_render.xdmf where bodies have /render. docs/bundle_format.md, "Trajectory". All appear under
/// their names in finish() and not before; without it nothing is left. Two equal runs give the same bytes except
/// /step_time.
class TrajectoryWriter {
 public:
  /// One or more bodies, of the same number of frames, as BodyFrames. Throws WorkError.
  TrajectoryWriter(const std::filesystem::path& path, const std::vector<NamedBody>& bodies);

  /// The next frame of a body. `step_seconds`: wall-clock time of the step that led to it.
  void append(std::size_t body, const State& state, const Energies& energies, double step_seconds) {
    frames_[body]->append(state, energies, step_seconds);
  }

  /// To be called after the last frame. Throws WorkError.
  void finish();

  std::size_t bodies() const { return frames_.size(); }
  /// Point that positions are measured from, once there is a frame [m].
  Eigen::Vector3d origin() const { return origin_.value_or(Eigen::Vector3d::Zero()); }
  /// Largest displacement of a vertex in the frames so far [m].
  double largest_displacement() const;

 private:
  std::vector<std::string> names_;
  AtomicFile output_;
  Hdf5File file_;
  std::optional<Eigen::Vector3d> origin_;
  std::vector<std::unique_ptr<BodyFrames>> frames_;
};

}  // namespace exmat::runtime
