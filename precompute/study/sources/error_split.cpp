#include "precompute/study/sources/error_split.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <functional>

namespace exmat::precompute {
namespace {

constexpr double kGood = 0.01;      // total error that needs no advice
constexpr double kAlsoLarge = 0.5;  // of the largest part: worth a word

void add(RelativeError& sum, const RelativeError& part) {
  sum.mean += part.mean;
  sum.max += part.max;
  sum.end += part.end;
  sum.settled += part.settled;
}

std::string rough_percent(double share) { return fmt::format("{:.2g} %", 100 * share); }

std::string what_to_turn(ErrorSource source, const PointKnobs& knobs) {
  switch (source) {
    case ErrorSource::kTimeStep:
      return fmt::format("take a smaller time_step than {:g} s", knobs.time_step);
    case ErrorSource::kEigenfunctions:
      return fmt::format("ask for more shape_space.eigenfunctions than {}", knobs.eigenfunctions);
    case ErrorSource::kAlignment:
      return "give the alignment more to go by: alignment.landmarks, alignment.map, or poses of the object's own mesh";
    case ErrorSource::kTargets:
      return "lower targets.tolerance, so that more displacements hold the targets";
    case ErrorSource::kBasis:
      return knobs.trained
                 ? fmt::format("ask for a larger basis.size than {}, or for more basis.training_segments",
                               knobs.basis_size)
                 : fmt::format("let the basis learn from runs (basis.training), or ask for a larger basis.size than {}",
                               knobs.basis_size);
    case ErrorSource::kCubature:
      return fmt::format("ask for more cubature.elements than {}", knobs.elements);
    case ErrorSource::kTable:
      break;
  }
  return knobs.target == "solve" ? "raise examples.target_iterations of the scene, or take target: table"
                                 : "lower targets.tolerance for more table nodes, or take target: solve";
}

}  // namespace

std::string setting_of(ErrorSource source) {
  switch (source) {
    case ErrorSource::kTimeStep:
      return "time_step, integrator";
    case ErrorSource::kEigenfunctions:
      return "shape_space.eigenfunctions";
    case ErrorSource::kAlignment:
      return "alignment";
    case ErrorSource::kTargets:
      return "targets.tolerance";
    case ErrorSource::kBasis:
      return "basis.size, basis.training";
    case ErrorSource::kCubature:
      return "cubature.elements";
    case ErrorSource::kTable:
      break;
  }
  return "targets.tolerance, target";
}

ErrorSplit split_error(const std::vector<ChainMotion>& chain, const std::vector<ErrorPart>& others,
                       const VertexArray& rest, const SparseMatrix& mass, bool free_body) {
  ErrorSplit split;
  split.parts = others;
  const BodyFrames& full = chain.front().frames;
  const auto distance = [&](const BodyFrames& frames, const BodyFrames& other) {
    return headline_distance(frames, other, full, rest, mass, free_body);
  };
  for (std::size_t i = 1; i < chain.size(); ++i) {
    const BodyFrames& now = chain[i].frames;
    const RelativeError added = distance(now, chain[i - 1].frames);
    split.total = distance(now, full);
    add(split.sum, added);
    split.parts.push_back({chain[i].source.value(), PartStatus::kMeasured, chain[i].note, added, split.total});
  }
  std::ranges::stable_sort(split.parts, {}, &ErrorPart::source);
  return split;
}

std::string advice_on(const ErrorSplit& split, const PointKnobs& knobs) {
  std::vector<const ErrorPart*> known;
  for (const ErrorPart& part : split.parts)
    if (part.added) known.push_back(&part);
  if (known.empty()) return "Nothing is approximated.";
  std::ranges::stable_sort(known, std::greater(), [](const ErrorPart* part) { return part->added->mean; });
  const ErrorPart* largest = known.front();
  const bool all_known =
      std::ranges::none_of(split.parts, [](const ErrorPart& part) { return part.status == PartStatus::kNotKnown; });
  const std::string name(exmat::name_of(largest->source));
  std::string text = split.total.mean <= kGood
                         ? fmt::format("Near the full problem ({}); the most of it is {} of {}: to come nearer, {}",
                                       rough_percent(split.total.mean), rough_percent(largest->added->mean), name,
                                       what_to_turn(largest->source, knobs))
                         : fmt::format("The most of the error of {} is {} of {}: {}", rough_percent(split.total.mean),
                                       rough_percent(largest->added->mean), name, what_to_turn(largest->source, knobs));
  if (known.size() > 1 && known[1]->added->mean >= kAlsoLarge * largest->added->mean)
    text += fmt::format("; next is {} with {}", exmat::name_of(known[1]->source), rough_percent(known[1]->added->mean));
  return text + (all_known ? "." : "; what is not known below is not among it.");
}

}  // namespace exmat::precompute
