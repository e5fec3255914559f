#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include "common/core/arrays.h"
#include "precompute/study/measure/rebound.h"

namespace exmat::precompute {

/// The motion of a body at some times: what errors are measured on.
struct BodyFrames {
  std::vector<double> times;                ///< F, ascending, > 0 [s]
  std::vector<VertexArray> positions;       ///< F, n x 3, world [m]
  std::vector<VertexArray> velocities;      ///< F, n x 3, world [m/s]
  std::vector<double> kinetic, elastic;     ///< F [J]
  std::vector<double> potential;            ///< F, of gravity [J]
  std::int64_t steps = 0, unconverged = 0;  ///< that were taken, and of them above Newton's tolerance
  double newton_iterations = 0;             ///< mean of a step
  double factorisations = 0;                ///< likewise
  double step_seconds = 0;                  ///< median; of one run, whatever else the machine did
  std::optional<Rebound> rebound;           ///< present for a free body with obstacles
};

/// At most so many times that all time steps hit, evenly spaced but for the last, which is the largest possible up to
/// `duration`. Throws InputError (without a file) where the time steps have no common multiple up to there.
std::vector<double> frame_times(double duration, std::vector<double> time_steps, int frames);

/// A file of frames: sizes, numbers, and a checksum of them.
void write_frames(const std::filesystem::path& file, const BodyFrames& frames);

/// Nothing where there is no such file, or where it is damaged.
std::optional<BodyFrames> read_frames(const std::filesystem::path& file);

}  // namespace exmat::precompute
