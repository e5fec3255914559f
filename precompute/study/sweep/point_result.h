#pragma once

#include <array>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "precompute/study/measure/error_metrics.h"
#include "precompute/study/measure/timing.h"
#include "precompute/study/sweep/settings.h"

namespace exmat::precompute {

/// Results of one point of a study.
struct PointResult {
  PointSettings settings;
  std::string key, bundle, reference;  ///< names of its files
  std::string failure;                 ///< empty: none, and the rest is there
  TrajectoryErrors errors;
  double worst_time = 0;                             ///< [s]
  std::optional<RelativeError> from_all_elements;    ///< headline against the same point with all elements
  std::optional<RelativeError> from_double;          ///< headline of mixed precision against the same point in double
  std::size_t modes = 0, elements = 0;               ///< r, s
  std::string internal_force, target;                ///< as the run took them
  double heldout_error = 0;                          ///< force error of cubature
  double precompute_seconds = 0;                     ///< time of its bundle, all stages
  double newton_iterations = 0, factorisations = 0;  ///< mean of a step
  std::int64_t steps = 0, unconverged_steps = 0;
  std::vector<std::string> warnings;  ///< warnings of its bundle
  std::optional<StepTimes> times;     ///< measured by the study itself; not in the point's file
};

/// Numbers that are not finite are null.
nlohmann::ordered_json to_json(const PointResult& result);
nlohmann::ordered_json to_json(const StepTimes& times);
StepTimes times_from_json(const nlohmann::ordered_json& json);

/// A file of one JSON value with a checksum.
void write_sealed(const std::filesystem::path& file, const nlohmann::ordered_json& content);
/// Nothing where there is no such file, or where it is damaged.
std::optional<nlohmann::ordered_json> read_sealed(const std::filesystem::path& file);

/// The point's file; nothing where there is none that is sound.
void write_point(const std::filesystem::path& file, const PointResult& result);
std::optional<PointResult> read_point(const std::filesystem::path& file);

}  // namespace exmat::precompute
