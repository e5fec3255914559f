#include "common/core/thread_team.h"

namespace exmat {

void run_shared(const SharedLoop& loop) noexcept {
  for (std::size_t i = 0; i < loop.count; ++i) loop.call(loop.work, i, 0);
}

void set_scheduler(const Scheduler&) noexcept {}

int processor_count() noexcept { return 1; }

}  // namespace exmat
