#include "precompute/pipeline/build_report.h"

#include "precompute/solvers/ranks.h"

namespace exmat::precompute {

std::int64_t peak_memory_bytes() { return peak_memory_of_ranks(); }

}  // namespace exmat::precompute
