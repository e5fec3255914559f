#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "precompute/study/measure/error_metrics.h"
#include "precompute/study/measure/timing.h"
#include "precompute/study/sweep/settings.h"
#include "precompute/study/sweep/study.h"

namespace exmat::precompute {

/// Errors of the motion of one body, or of all.
struct WorldError {
  std::string name;  ///< the body's; "all": all together
  RelativeError position, velocity;
  std::optional<RelativeError> shape;  ///< present for a free body
  double energy = 0;
};

/// Results of one point of a study of several bodies.
struct WorldPointResult {
  std::vector<PointSettings> settings;       ///< one for each entry of the scene's bodies
  std::string key, failure;                  ///< empty: none, and the rest is there
  std::vector<WorldError> errors;            ///< all together, then each body
  std::vector<std::size_t> modes, elements;  ///< one for each entry
  double newton_iterations = 0;              ///< mean of a step
  std::int64_t steps = 0, unconverged_steps = 0;
  double precompute_seconds = 0;   ///< time of its bundles
  std::optional<StepTimes> times;  ///< time of a step over the number of bodies
};

/// One full-space run that points are measured against.
struct WorldReferenceResult {
  std::string key, failure;
  double time_step = 0;  ///< [s]
  std::string integrator;
  std::int64_t steps = 0, unconverged_steps = 0;
  double newton_iterations = 0, step_seconds = 0;  ///< mean; median, of all bodies
};

struct WorldStudyResult {
  std::string name;
  std::vector<std::string> kinds;   ///< entries of the scene's bodies
  std::vector<std::string> bodies;  ///< all of them
  std::vector<double> times;        ///< times of the frames [s]
  std::vector<WorldPointResult> points;
  std::vector<WorldReferenceResult> references;
  std::vector<std::size_t> front;  ///< places in `points`, by error of position of all and time, ascending in time
  std::optional<std::size_t> recommended;

  std::size_t failures() const;
};

nlohmann::ordered_json to_json(const WorldStudyResult& result);
/// One header line, then for each point a line of all bodies and one of each.
std::string world_results_csv(const WorldStudyResult& result);

/// True if a study's scene is one of several bodies.
bool is_of_bodies(const StudyConfig& config);

/// A study of a scene of several bodies: bundles each of its kinds with the settings of each point, and measures their
/// motion against that of all bodies with all their degrees of freedom. Runs what is not finished in the folder, times
/// all points, writes results.json and results.csv. Throws InputError for what is wrong with the files, or cannot be
/// measured.
WorldStudyResult run_world_study(const StudyConfig& config, const StudyOptions& options);

}  // namespace exmat::precompute
