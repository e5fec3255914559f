#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "precompute/study/measure/inverted_tets.h"
#include "precompute/study/sources/error_split.h"
#include "precompute/study/sweep/pareto.h"
#include "precompute/study/sweep/point_result.h"
#include "precompute/study/sweep/study_config.h"

namespace exmat::precompute {

struct StudyOptions {
  std::filesystem::path folder;  ///< made where it is not there
  int jobs = 1;                  ///< processes; times are measured by one
  Budget budget;                 ///< absent limits: nothing is recommended
};

/// One full-space run that points are measured against.
struct ReferenceResult {
  std::string key;
  int eigenfunctions = 0;  ///< number for its examples; 0: none
  double time_step = 0;    ///< [s]
  std::string integrator, material, failure;
  std::int64_t steps = 0, unconverged_steps = 0;
  double newton_iterations = 0, factorisations = 0, step_seconds = 0;  ///< means; median, of one run
  InvertedTets inverted;  ///< tets inverted in its frames: where there are any, its errors are of no true motion
};

/// A point's worst frame: positions [n x 3], reduced (of a free body turned and shifted onto the other) and in full
/// space.
struct WorstFrame {
  std::size_t point = 0;
  VertexArray reduced, full;
};

struct StudyResult {
  StudyConfig config;
  std::string asset_name;
  std::int64_t vertices = 0, tets = 0;
  bool free_body = false;
  bool has_examples = false;         ///< true for examples of the whole body or of regions
  std::vector<std::string> regions;  ///< that the scene names
  std::vector<double> times;         ///< times of the frames [s]
  std::vector<PointResult> points;
  std::vector<ReferenceResult> references;
  std::vector<std::size_t> front;  ///< indices into `points`, ascending in time
  std::size_t own = 0;             ///< the point of the files' own settings, else the first
  Budget budget;
  std::optional<std::size_t> recommended, nearest;
  std::optional<ErrorSplit> sources;     ///< split for the recommended point, else for `own`
  std::vector<WorstFrame> worst_frames;  ///< the least accurate point's, the files' own and the recommended one's
  TriangleArray surface;                 ///< n_f x 3
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();  ///< against gravity
  std::string processor, instruction_set;

  std::size_t failures() const;  ///< points and sources of errors

  /// Error that points are chosen by, TrajectoryErrors::headline(): "shape" or "position".
  const char* headline() const { return free_body ? "shape" : "position"; }
  /// Null where it is not among the references.
  const ReferenceResult* reference_of(const PointResult& point) const;
  /// True if the full space that a point is measured against is free of inverted tets.
  bool has_truth(const PointResult& point) const;
  /// One sentence of what is wrong with the references and what to do; empty where nothing is.
  std::string truth_warning() const;
};

/// Error, TrajectoryErrors::headline(), and time of a step of each point; those of failed ones are not finite.
std::vector<Outcome> outcomes(const std::vector<PointResult>& points);

/// Runs what is not finished in the folder, times all points, and writes report.html, results.csv, results.json, where
/// errors are split the three files sources.*, and, where a budget is met, recommended_asset.json and
/// recommended_scene.json. A point that fails is told in the result and the study goes on. Throws InputError for what
/// is wrong with the files.
StudyResult run_study(const StudyConfig& config, const StudyOptions& options);

}  // namespace exmat::precompute
