#pragma once

#include <cstdint>
#include <fmt/format.h>
#include <string>
#include <type_traits>
#include <vector>

#include "common/core/log.h"
#include "common/core/progress.h"
#include "common/core/timer.h"
#include "common/model/needs.h"
#include "precompute/cache/stage_cache.h"
#include "precompute/inputs/inputs.h"

namespace exmat::precompute {

struct StageTime {
  std::string stage;
  double seconds = 0;
  std::int64_t peak_memory_bytes = 0;  ///< most that any rank had until the stage's end
};

/// Results of a run beside the model.
struct BuildReport {
  std::vector<StageTime> stages;    ///< that ended, in order
  std::vector<LedgerEntry> ledger;  ///< groups in and out, and why; bytes are the writer's to fill in
  InputFiles inputs;
  std::string input_sha256;           ///< hash of all that the bundle is computed from; empty until it is read
  std::vector<CacheUse> cache;        ///< in order; none without a cache
  std::vector<std::string> warnings;  ///< also in the log
};

/// Most memory that any rank has had so far.
std::int64_t peak_memory_bytes();

/// Runs a stage and returns its result; it is logged, reported as progress and entered in `report` when it ends.
template <typename Work>
auto timed_stage(const std::string& stage, BuildReport& report, Work work) {
  log::info(stage);
  const Progress progress(stage, 0);
  const Timer timer;
  const auto enter = [&] {
    report.stages.push_back({stage, timer.seconds(), peak_memory_bytes()});
    log::info(fmt::format("{}: {:.3f} s, peak memory {:.1f} MB", stage, timer.seconds(),
                          1e-6 * static_cast<double>(report.stages.back().peak_memory_bytes)));
  };
  if constexpr (std::is_void_v<std::invoke_result_t<Work>>) {
    work();
    enter();
  } else {
    auto result = work();
    enter();
    return result;
  }
}

}  // namespace exmat::precompute
