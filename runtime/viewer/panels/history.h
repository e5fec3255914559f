#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "runtime/viewer/simulation/snapshot.h"

namespace exmat::viewer {

/// The last so many values of some numbers that are plotted together.
class Series {
 public:
  static constexpr std::size_t kLength = 240;

  void add(const std::vector<float>& values);
  void clear() { lines_.clear(); }
  std::size_t lines() const { return lines_.size(); }
  const std::vector<float>& line(std::size_t i) const { return lines_[i]; }
  /// Over all lines.
  float least() const;
  float most() const;

 private:
  std::vector<std::vector<float>> lines_;
};

/// Time of a step by stage, lately [us].
struct StageTimes {
  static constexpr std::size_t kStages = 6;
  static constexpr std::array<const char*, kStages> kNames{"weights", "target",  "internal force",
                                                           "solve",   "contact", "the rest"};
  std::array<float, kStages> microseconds{};
  float total = 0;
  float newton_iterations = 0;
};

/// Curves and numbers that plots show of the body that was looked at.
class History {
 public:
  /// Adds a picture; `times` are those of all steps since the one before.
  void add(const Snapshot& snapshot, const StepTimes& times);

  std::vector<Series> weights;  ///< one for each example force of the first body
  Series energies;              ///< kinetic, elastic, of gravity [J]
  StageTimes stages;
  std::uint32_t status = 0;  ///< bits of the last steps

 private:
  double time_ = -1;
};

/// Meanings of status bits.
std::vector<std::string> status_words(std::uint32_t status);

}  // namespace exmat::viewer
