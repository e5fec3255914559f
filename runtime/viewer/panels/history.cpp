#include "runtime/viewer/panels/history.h"

#include <algorithm>

namespace exmat::viewer {

void Series::add(const std::vector<float>& values) {
  if (lines_.size() != values.size()) lines_.assign(values.size(), {});
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (lines_[i].size() == kLength) lines_[i].erase(lines_[i].begin());
    lines_[i].push_back(values[i]);
  }
}

float Series::least() const {
  float least = 0;
  for (const auto& line : lines_)
    for (const float value : line) least = std::min(least, value);
  return least;
}

float Series::most() const {
  float most = 0;
  for (const auto& line : lines_)
    for (const float value : line) most = std::max(most, value);
  return most;
}

void History::add(const Snapshot& snapshot, const StepTimes& times) {
  if (snapshot.time < time_) {
    energies.clear();
    weights.clear();
  }
  if (snapshot.time != time_) {
    const BodySnapshot& body = snapshot.bodies.front();
    weights.resize(body.weights.size());
    for (std::size_t i = 0; i < weights.size(); ++i) weights[i].add({body.weights[i].begin(), body.weights[i].end()});
    const exmat_energies& energy = body.energies;
    energies.add(
        {static_cast<float>(energy.kinetic), static_cast<float>(energy.elastic), static_cast<float>(energy.potential)});
  }
  time_ = snapshot.time;
  if (times.steps == 0) return;
  status = times.status;
  constexpr double kMemory = 0.9;  // a number that jumps cannot be read
  const bool first = stages.total == 0;
  const auto blend = [&](float& value, double now) {
    value = static_cast<float>(first ? now : kMemory * value + (1 - kMemory) * now);
  };
  const double steps = static_cast<double>(times.steps), scale = 1e6 / steps;
  const exmat_profile& of = times.stages;
  const double known = of.weights + of.target + of.internal_force + of.solve + of.contact;
  const std::array<double, StageTimes::kStages> seconds{of.weights, of.target,  of.internal_force,
                                                        of.solve,   of.contact, std::max(0.0, times.seconds - known)};
  for (std::size_t i = 0; i < seconds.size(); ++i) blend(stages.microseconds[i], scale * seconds[i]);
  blend(stages.total, scale * std::max(known, times.seconds));
  blend(stages.newton_iterations, static_cast<double>(times.newton_iterations) / steps);
}

std::vector<std::string> status_words(std::uint32_t status) {
  std::vector<std::string> words;
  if ((status & EXMAT_STEP_NON_FINITE) != 0) words.emplace_back("a number was not finite: the step was not taken");
  if ((status & EXMAT_STEP_ITERATION_LIMIT) != 0) words.emplace_back("the residual is above the tolerance");
  if ((status & EXMAT_STEP_STAGNATED) != 0) words.emplace_back("no descent was left: rounding");
  if ((status & EXMAT_STEP_TARGET_NOT_CONVERGED) != 0) words.emplace_back("the target is still on its way");
  return words;
}

}  // namespace exmat::viewer
