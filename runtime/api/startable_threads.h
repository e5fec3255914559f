#pragma once

namespace exmat::runtime {

/// How many of `wanted` >= 1 threads a team of this thread can have: no more than there are processors, nor than the
/// system lets start. OpenMP ends the whole process where a thread does not start; so those that no team of this thread
/// had before are started here first, where that is noticed.
int startable_threads(int wanted) noexcept;

}  // namespace exmat::runtime
