#include "precompute/examples/rest_placing.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <fmt/format.h>
#include <vector>

namespace exmat::precompute {
namespace {

constexpr double kBetter = 0.5;            // of a gap, for another rotation or the mirror image to be believed
constexpr double kCompeting = 1.4;         // of the best rotation's gap
constexpr double kCompetingFloor = 0.005;  // added to it: below, rotations differ by the tessellation alone
constexpr double kFits = 0.05;             // a gap of a body that lies on the other
constexpr double kAnotherBody = 0.08;      // a gap that is worth a warning: a cylinder has 5 % from a square bar
constexpr double kLacking = 0.15;          // distance from the other surface, over the body's size
constexpr double kLackingShare = 0.08;     // of the area; two cars of different makes have 5 %

double angle_of(const Eigen::Matrix3d& rotation) { return Eigen::AngleAxisd(rotation).angle(); }

}  // namespace

RestTurn RestPlacing::turn() {
  if (turn_) return *turn_;
  const std::vector<RigidFit> fits = fitter_.fits(false);
  const double best = fits.front().gap;
  RestTurn& turn = turn_.emplace();
  if (gap(fits.front().rotation) > kBetter * gap(turn.rotation)) return turn;
  turn.rotation = fits.front().rotation;
  for (auto fit = fits.begin() + 1; fit != fits.end(); ++fit) {
    if (fit->gap > kCompeting * best + kCompetingFloor) continue;
    ++turn.competing;
    if (angle_of(fit->rotation) < angle_of(turn.rotation)) turn.rotation = fit->rotation;
  }
  return turn;
}

void RestPlacing::judge(const RestTurn& taken, AlignmentOutcome& outcome) {
  outcome.competing_maps = taken.competing;
  outcome.residual = gap(taken.rotation);
  std::string advice = "expected a rest example that has about the object's shape and lies where it does";
  if (outcome.residual > kFits) {
    const RestTurn better = turn();
    const double least = std::min(outcome.residual, gap(better.rotation)),
                 mirrored = gap(fitter_.fits(true).front().rotation);
    if (mirrored < kBetter * least)
      object_to(
          outcome, mirrored < kFits ? AlignmentVerdict::kRefused : AlignmentVerdict::kDoubtful,
          fmt::format("its mirror image is {:.1f} % from the object (of the body's size), it {:.1f} %: mirror the "
                      "rest example and its poses back",
                      100 * mirrored, 100 * least));
    if (least < kBetter * outcome.residual)
      advice = fmt::format(
          "the examples stand {} against the object: turned back, the rest example is {:.1f} % from "
          "it; turn their files, or say alignment.frame \"auto\"",
          describe_turn(better.rotation), 100 * least);
  }
  if (taken.competing > 0)
    object_to(
        outcome, AlignmentVerdict::kRefused,
        fmt::format("it stands otherwise than the object, perhaps {}, but {} of its symmetric body {} as well; "
                    "turn it and its poses as the object stands, or give alignment.landmarks with its vertices",
                    describe_turn(taken.rotation),
                    taken.competing == 1 ? "another rotation" : fmt::format("{} other rotations", taken.competing),
                    taken.competing == 1 ? "fits" : "fit"));
  const auto [of_rest, of_object] = fitter_.uncovered(taken.rotation, kLacking);
  if (std::max(of_rest, of_object) > kLackingShare)
    object_to(outcome, AlignmentVerdict::kDoubtful,
              fmt::format("{:.0f} % of the {}'s surface is farther than {:.0f} % of the body's size from the {}: has "
                          "the rest example the object's parts?",
                          100 * std::max(of_rest, of_object), of_rest > of_object ? "rest example" : "object",
                          100 * kLacking, of_rest > of_object ? "object" : "rest example"));
  judge_doubt(outcome, advice);
  judge_residual(outcome, advice, kAnotherBody);
}

}  // namespace exmat::precompute
