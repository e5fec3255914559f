#pragma once

#include "common/core/thread_team.h"

namespace exmat::runtime {

/// Calls work(i, thread) for i < count, each once, by so many threads, numbered from 0, that take `share` of them at a
/// time. One thread alone asks for nothing: that takes a tenth of a microsecond.
template <class Work>
void for_all_by_threads(std::size_t count, int threads, const Work& work, int share) {
  by_threads(count, threads, static_cast<std::size_t>(share), work);
}

/// Calls work(i) for i < count, likewise.
template <class Work>
void for_all(std::size_t count, int threads, const Work& work, int share = 4) {
  by_threads(count, threads, static_cast<std::size_t>(share), [&](std::size_t i, std::size_t) { work(i); });
}

}  // namespace exmat::runtime
