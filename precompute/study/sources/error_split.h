#pragma once

#include <optional>
#include <string>
#include <vector>

#include "common/core/names.h"
#include "precompute/study/measure/error_metrics.h"

namespace exmat::precompute {

/// Approximations on the way from the full problem to a reduced motion, step by step.
/// docs/error_metrics.md, "Errors by source".
enum class ErrorSource { kTimeStep, kEigenfunctions, kAlignment, kTargets, kBasis, kCubature, kTable };

/// Availability of a part.
enum class PartStatus {
  kMeasured,
  kNone,      ///< there is no such approximation
  kLeftOut,   ///< the study does not ask for it
  kNotKnown,  ///< there is one, and nothing to measure it by
};

/// The error of one source.
struct ErrorPart {
  ErrorSource source = ErrorSource::kTimeStep;
  PartStatus status = PartStatus::kNone;
  std::string note;                     ///< comparison in words, or why there is none
  std::optional<RelativeError> added;   ///< from the motion before to the one with this approximation as well
  std::optional<RelativeError> so_far;  ///< from the full problem to the latter
};

/// The error of a point of a study against the full problem, by what adds to it. All parts are over the size of the
/// full problem's motion, so that `total` is at most `sum`.
struct ErrorSplit {
  std::size_t point = 0;
  std::string failure;           ///< empty: none, and the rest is there
  std::string full_problem;      ///< motion that the parts are measured from, in words
  std::vector<ErrorPart> parts;  ///< one for each source, in order
  RelativeError total, sum;
  bool no_truth = false;  ///< the full problem has inverted tets
  std::string advice;     ///< one sentence: which setting to turn
};

/// One motion of the chain from the full problem to the reduced one.
struct ChainMotion {
  std::optional<ErrorSource> source;  ///< source that it has and the motion before has not; the first: none
  std::string note;                   ///< comparison in words
  BodyFrames frames;
};

/// The parts of a chain of at least one motion; `others` are the sources that have no motion in it.
ErrorSplit split_error(const std::vector<ChainMotion>& chain, const std::vector<ErrorPart>& others,
                       const VertexArray& rest, const SparseMatrix& mass, bool free_body);

/// Settings of the sources in the point whose error was split.
struct PointKnobs {
  int eigenfunctions = 0, basis_size = 0;
  std::size_t elements = 0;
  double time_step = 0;  ///< [s]
  bool trained = false;  ///< its basis has learned from runs in full space
  std::string target;    ///< "table", "solve" or "none"
};

/// The sentence about the largest part.
std::string advice_on(const ErrorSplit& split, const PointKnobs& knobs);

/// Names of the settings to turn if the part of a source is too large.
std::string setting_of(ErrorSource source);

}  // namespace exmat::precompute

namespace exmat {
template <>
inline constexpr std::array<std::string_view, 7> kNames<precompute::ErrorSource>{
    "time_step", "eigenfunctions", "alignment", "targets", "basis", "cubature", "table"};
template <>
inline constexpr std::array<std::string_view, 4> kNames<precompute::PartStatus>{"measured", "none", "left_out",
                                                                                "not_known"};
}  // namespace exmat
