#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "runtime/scene/bodies.h"
#include "runtime/scene/samples.h"

namespace exmat::runtime {

/// The contacts of a body of a kind when they pressed it most.
struct HardestContact {
  int body = -1;         ///< -1: nothing touched any
  double force = 0;      ///< their sum [N]
  double time = 0;       ///< [s]
  Eigen::VectorXd load;  ///< [3n] of obstacles and of other bodies, in the body's own frame
};

/// Times of the stages of a step, over the number of bodies.
struct StageSamples {
  std::array<Samples, kStageNames.size()> of_bodies;      ///< bodies that touch no other, by the threads' clocks;
                                                          ///< output per frame
  std::array<Samples, kWorldStageNames.size()> of_world;  ///< on the wall clock
};

/// A vertex that begins inside an obstacle or another body, deeper than one step lets out at kRelease.
struct StartOverlap {
  int body = 0, other = 0;  ///< numbers in the world; `other` of the obstacles that the body meets, if it is one
  bool is_obstacle = false;
  int vertex = 0;    ///< number in the body's object
  double depth = 0;  ///< [m]
};

/// An attachment that bore more than it can.
struct BrokenAttachment {
  int body = 0;       ///< number in the world
  std::string place;  ///< JSON pointer in the scene
  double time = 0;    ///< end of the step [s]
  double force = 0;   ///< in that step [N]
};

/// Results of a run.
struct RunSummary {
  std::int64_t steps = 0;  ///< steps of each body
  int bodies = 1;
  int threads = 1;  ///< that shared the bodies
  double simulated_seconds = 0;
  Samples step_seconds;                ///< wall clock of a step of all bodies over their number, without output
  Samples newton_iterations;           ///< mean of the bodies
  Samples target_iterations;           ///< likewise
  std::int64_t projections = 0;        ///< sum over all bodies
  std::int64_t unconverged_steps = 0;  ///< residual above the tolerance; of all bodies
  std::int64_t divided_steps = 0;      ///< taken in several smaller ones; of all bodies
  std::int64_t slept_steps = 0;        ///< that bodies slept through; of all bodies
  Samples touching_pairs;              ///< pairs of bodies near enough to touch
  int most_pairs = 0;
  int largest_island = 0;                            ///< bodies solved together
  std::int64_t unconverged_islands = 0;              ///< sum over all steps
  double deepest = 0;                                ///< that a vertex is inside another body at the end [m]
  Energies start, end;                               ///< sums over all bodies
  std::vector<BrokenAttachment> broken;              ///< in this run, in order
  std::optional<double> farthest_reach;              ///< at the end, see Bodies
  std::optional<StartOverlap> overlap;               ///< the deepest, where bodies overlap something at the start
  std::uint64_t state_hash = 0;                      ///< hash of all bodies at the end; see Bodies::hash
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();  ///< origin of the trajectory [m]
  std::optional<double> largest_displacement;        ///< over the written frames [m]; only with a trajectory
  std::vector<HardestContact> hardest_contacts;      ///< one for each kind; only if asked for
  std::optional<StageSamples> stage_seconds;         ///< only if asked for
};

struct RunOptions {
  bool profiled = false;                              ///< measure each stage
  bool keeps_contacts = false;                        ///< remember the hardest
  std::optional<std::filesystem::path> from_state{};  ///< a state file to begin at, instead of the scene's start
  std::optional<std::filesystem::path> dump_state{};  ///< a state file to write at the end, or before a bad step
};

/// Steps all bodies of a loaded scene from its start or from a state file, as many steps as it says, and writes the
/// trajectory, if it names one: of all bodies that it lists, or of the first of the `instances`. As many threads as
/// OpenMP gives. Throws WorkError where a state becomes non-finite (see Bodies::require_finite; no trajectory is left)
/// or a file cannot be written, InputError where the state file does not fit.
RunSummary run(const LoadedWorld& loaded, const WorldConfig& config, const RunOptions& options = {});

}  // namespace exmat::runtime
