#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <vector>

#include "precompute/study/stability/checks.h"

namespace exmat::precompute {

/// A run of a scene with one thing changed, and its verdict.
struct SceneRun {
  std::string dimension;  ///< "time step"; empty: the scene as it is
  std::string variant;    ///< "16 x"
  double time_step = 0;   ///< [s]
  RunRecord record{};
  CheckResults checks{};
  std::vector<Eigen::VectorXd> end{};  ///< q of each body

  bool passes() const { return gravest(checks) == Verdict::kPass; }
  /// Checks that failed, each with its value and limit; empty where none did.
  std::string failures() const;
};

/// A row of the table "safe up to".
struct SafeRange {
  std::string dimension;
  std::string own;      ///< the scene's value, with its unit
  std::string safe{};   ///< the last variant that passes with all before it
  std::string fails{};  ///< variants that fail, and by which check
};

/// A scene as it is, and pushed along each dimension.
struct SceneStudy {
  std::string scene;
  double duration = 0;           ///< [s]
  std::vector<SceneRun> runs{};  ///< the first is the scene as it is
  std::vector<SafeRange> ranges{};
  std::vector<std::string> not_tested{};  ///< each with its reason

  std::string headline() const;
};

/// Runs a scene with its time step times 1/4 to 16, loads, speeds, kappa and contact stiffness times 10 and 100, and
/// starts that are flat, mirrored and random; judges each run. `jobs` runs at a time of a scene of one body; results do
/// not depend on it. Reports progress. Throws InputError where the scene or its bundles are not sound.
SceneStudy study_scene(const std::filesystem::path& file, int jobs = 1);

/// Headline, table "safe up to" and what was not tested.
std::string scene_study_markdown(const SceneStudy& study);

/// Claims the files that write_scene_study() will write, as outputs of the command. Throws InputError.
void claim_scene_study(const std::filesystem::path& folder);

/// Writes stability.html, .md, .csv and .json into a folder, which is made. Each appears whole or not at all. Throws
/// WorkError.
void write_scene_study(const SceneStudy& study, const std::filesystem::path& folder);

}  // namespace exmat::precompute
