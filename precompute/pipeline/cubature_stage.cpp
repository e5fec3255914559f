#include "precompute/pipeline/cubature_stage.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <limits>
#include <utility>

#include "common/core/log.h"

namespace exmat::precompute {
namespace {

constexpr int kSelections = 4;
constexpr std::uint64_t kNextSeed = 7919;  // far from the seeds that one selection draws from

}  // namespace

CubatureData choose_cubature(const BodyStages& stages, const PoseSource& source, const CubatureOptions& options,
                             const ReducedModel& model, const Motions* motions, StageCache& cache) {
  const auto select = [&](const CubatureOptions& own) {
    return cache.get(
        "cubature", [&] { return build_cubature(stages.object.mesh, stages.object.materials, source, own); },
        stages.object.mesh, stages.object.materials, source, own);
  };
  const bool one = motions == nullptr || motions->elements;  // where tets are many each takes its time
  if (one || options.tolerance || options.method == CubatureMethod::kAllElements) return select(options);
  CubatureData best;
  CubatureOptions best_options = options;
  double least = std::numeric_limits<double>::infinity();
  std::vector<double> errors;
  for (int i = 0; i < kSelections; ++i) {
    CubatureOptions own = options;
    own.seed += static_cast<std::uint64_t>(i) * kNextSeed;
    own.measured = false;  // but the one that is kept
    CubatureData data = select(own);
    errors.push_back(100 * cubature_roll_out(stages, model, data, *motions).shape);
    if (i > 0 && !(errors.back() < least)) continue;
    least = errors.back();
    best = std::move(data);
    best_options = own;
  }
  log::info(fmt::format("cubature: error in held-out runs of {} selections {:.2f} %", errors.size(),
                        fmt::join(errors, " %, ")));
  best_options.measured = true;
  return cache.get(
      "errors of the cubature",
      [&] { return measured_cubature(best, stages.object.mesh, stages.object.materials, source, best_options); },
      stages.object.mesh, stages.object.materials, source, best_options);
}

}  // namespace exmat::precompute
