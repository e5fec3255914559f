#include "precompute/examples/alignment_verdict.h"

#include <fmt/format.h>
#include <numbers>

#include "common/core/error.h"
#include "common/core/log.h"

namespace exmat::precompute {
namespace {

constexpr double kDoubtWarning = 0.5, kDoubtRefusal = 1.2;
constexpr double kInvertedLimit = 0.05;
// Shares of the volume and of the surface that no pose has.
constexpr double kSqueezedWarning = 0.025, kUncoveredWarning = 0.05;
constexpr double kResidualRefusal = 0.15;
// Rotations of a whole pose that its frame, taken to be the object's, makes unlikely and incredible [rad].
constexpr double kTurnWarning = 50 * std::numbers::pi / 180, kTurnRefusal = 80 * std::numbers::pi / 180;
// A distance of landmarks, over the body's size, that is to blame for a doubt.
constexpr double kSeriouslyMissed = 0.1;
// A displacement, over the body's size, that says nothing was found.
constexpr double kNoDisplacement = 0.03;

const std::string kLandmarks = "alignment.landmarks (8 vertices that do not lie in a plane)";
const std::string kSameMeshAdvice = "a pose of the rest example's own mesh, which needs no alignment";

// A surface that is met this well is that of the rest example's body: what is left to doubt is which of its poses it
// is.
constexpr double kMet = 0.05;

// Examples stand alike as a rule, so the least moved pose is meant unless the asset says that frames are free.
void judge_competitors(const PoseAlignment& alignment, bool met, bool free_frame, AlignmentOutcome& outcome) {
  if (!alignment.ambiguous) return;
  if (met)
    return object_to(
        outcome, AlignmentVerdict::kDoubtful,
        fmt::format("{} other pose{} as well, for the body is nearly symmetric; taken is the one nearest to "
                    "the rest example as it stands. If it is another one, give {}, or {}",
                    alignment.competing_maps, alignment.competing_maps == 1 ? " fits" : "s fit", kLandmarks,
                    kSameMeshAdvice));
  const std::string others = alignment.competing_maps == 1
                                 ? "another pose fits as well"
                                 : fmt::format("{} other poses fit as well", alignment.competing_maps);
  object_to(outcome, AlignmentVerdict::kRefused,
            free_frame ? fmt::format("{}, for the body is symmetric and the example's frame unknown; give {}, or "
                                     "alignment.frame \"shared\" if it stands as the object does, or {}",
                                     others, kLandmarks, kSameMeshAdvice)
                       : fmt::format("{} and {} no farther from rest; give {}, or {}", others,
                                     alignment.competing_maps == 1 ? "is" : "are", kLandmarks, kSameMeshAdvice));
}

// A pose that lacks a part of the body, or has one more: what is left is crushed into it, or drawn over it.
void judge_parts(const PoseAlignment& alignment, AlignmentOutcome& outcome) {
  const std::string advice = "has the pose all parts of the rest example, and no others?";
  if (alignment.squeezed_fraction > kSqueezedWarning)
    object_to(outcome, AlignmentVerdict::kDoubtful,
              fmt::format("{:.0f} % of the rest example's volume shrinks to less than half beside the whole, or grows "
                          "to more than twice; {}",
                          100 * alignment.squeezed_fraction, advice));
  if (alignment.uncovered > kUncoveredWarning)
    object_to(outcome, AlignmentVerdict::kDoubtful,
              fmt::format("{:.0f} % of a surface is far from the other; {}", 100 * alignment.uncovered, advice));
}

void judge_revolution(const PoseAlignment& alignment, AlignmentOutcome& outcome) {
  if (!alignment.hides_twist) return;
  const std::string advice = fmt::format("give alignment.map, or {}", kSameMeshAdvice);
  if (alignment.displacement < kNoDisplacement)
    object_to(
        outcome, AlignmentVerdict::kRefused,
        "the rest example is a body of revolution and the pose looks like it: a twist leaves no trace; " + advice);
  else
    object_to(outcome, AlignmentVerdict::kDoubtful,
              "the rest example is a body of revolution: a turn about its axis leaves no trace; if the pose has any, " +
                  advice);
}

void judge_turn(const PoseAlignment& alignment, AlignmentOutcome& outcome) {
  const double degrees = alignment.turn * 180 / std::numbers::pi;
  const auto message = fmt::format(
      "the pose is turned by {:.0f} degrees as a whole, though its frame is taken to be the object's; say "
      "alignment.frame \"shared\" if it is, or \"free\"",
      degrees);
  if (alignment.turn > kTurnRefusal) object_to(outcome, AlignmentVerdict::kRefused, message);
  if (alignment.turn > kTurnWarning) object_to(outcome, AlignmentVerdict::kDoubtful, message);
}

}  // namespace

const char* name_of(AlignmentVerdict verdict) {
  if (verdict == AlignmentVerdict::kGood) return "good";
  return verdict == AlignmentVerdict::kDoubtful ? "doubtful" : "refused";
}

void object_to(AlignmentOutcome& outcome, AlignmentVerdict verdict, const std::string& message) {
  if (outcome.verdict >= verdict) return;
  outcome.verdict = verdict;
  outcome.message = outcome.message.empty() ? message : message + "; besides, " + outcome.message;
}

void judge_doubt(AlignmentOutcome& outcome, const std::string& advice) {
  if (outcome.inverted_fraction >= kInvertedLimit)
    object_to(outcome, AlignmentVerdict::kRefused,
              fmt::format("the map turns {:.1f} % of the volume inside out (limit 5 %); {}",
                          100 * outcome.inverted_fraction, advice));
  const auto objection = fmt::format("doubt {:.2f} (below {} is good, above {} refused); {}", outcome.doubt,
                                     kDoubtWarning, kDoubtRefusal, advice);
  if (outcome.doubt > kDoubtRefusal) object_to(outcome, AlignmentVerdict::kRefused, objection);
  if (outcome.doubt > kDoubtWarning) object_to(outcome, AlignmentVerdict::kDoubtful, objection);
}

void judge_residual(AlignmentOutcome& outcome, const std::string& advice, double warning) {
  const auto misfit = fmt::format("its surface is {:.1f} % from what was found (of the body's size); {}",
                                  100 * outcome.residual, advice);
  if (outcome.residual > kResidualRefusal) object_to(outcome, AlignmentVerdict::kRefused, misfit);
  if (outcome.residual > warning) object_to(outcome, AlignmentVerdict::kDoubtful, misfit);
}

void judge_pose(const PoseAlignment& alignment, AlignmentFrame frame, bool free_frame, AlignmentOutcome& outcome) {
  outcome.residual = alignment.residual;
  outcome.doubt = alignment.doubt;
  outcome.inverted_fraction = alignment.inverted_fraction;
  outcome.competing_maps = alignment.competing_maps;
  const bool met = frame != AlignmentFrame::kFree && alignment.residual <= kMet;
  if (alignment.mirrored)
    object_to(outcome, met ? AlignmentVerdict::kDoubtful : AlignmentVerdict::kRefused,
              fmt::format("the mirror image of the rest example fits: its surface is {:.1f} % from the pose's (of the "
                          "body's size), the rest example's own {:.1f} %; mirror the example back, or give {}",
                          100 * alignment.mirror_residual, 100 * alignment.residual, kSameMeshAdvice));
  judge_parts(alignment, outcome);
  const std::string advice =
      alignment.missed_landmarks > kSeriouslyMissed
          ? fmt::format("the landmarks are {:.0f} % of the body's size from where they belong: do they correspond?",
                        100 * alignment.missed_landmarks)
          : fmt::format("is it the rest example's body? If so, give {}, or {}", kLandmarks, kSameMeshAdvice);
  judge_doubt(outcome, advice);
  judge_residual(outcome, advice);
  judge_competitors(alignment, met, free_frame, outcome);
  judge_revolution(alignment, outcome);
  if (frame == AlignmentFrame::kAuto && !free_frame) judge_turn(alignment, outcome);
}

void judge_landmarks(const PoseAlignment& alignment, const std::vector<Eigen::Index>& numbers,
                     AlignmentOutcome& outcome) {
  if (alignment.left_out.empty()) return;
  std::string names;
  for (const LeftOutLandmark& landmark : alignment.left_out)
    names += fmt::format("{}landmark {} misses by {:.0f} % of the body's size", names.empty() ? "" : ", ",
                         numbers[landmark.index], 100 * landmark.missed);
  const std::string message = names + " from where the others and the surface have it: left out; does it correspond?";
  if (outcome.verdict == AlignmentVerdict::kGood)
    object_to(outcome, AlignmentVerdict::kDoubtful, message);
  else
    outcome.message += "; besides, " + message;
}

void require_aligned(const AssetConfig& asset, const std::vector<AlignmentOutcome>& outcomes,
                     std::vector<std::string>& warnings) {
  std::string refusals;
  for (const AlignmentOutcome& outcome : outcomes) {
    if (outcome.verdict == AlignmentVerdict::kGood) continue;
    const bool refused = outcome.verdict == AlignmentVerdict::kRefused;
    const std::string message =
        fmt::format("example {}: alignment {}: {}", outcome.name, refused ? "refused" : "doubtful", outcome.message);
    if (!refused || asset.alignment.accept)
      warn(warnings, message + (refused ? " (taken, as alignment.accept says)" : ""));
    else
      refusals += (refusals.empty() ? "" : "\n") + message;
  }
  if (!refusals.empty()) throw WorkError(refusals);
}

void warn(std::vector<std::string>& warnings, const std::string& message) {
  warnings.push_back(message);
  log::warning(message);
}

}  // namespace exmat::precompute
