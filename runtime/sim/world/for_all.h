#pragma once

#include <cstddef>
#include <omp.h>

namespace exmat::runtime {

/// Calls work(i, thread) for i < count, each once, by so many threads, numbered from 0, that take `share` of them at a
/// time. One thread alone asks OpenMP for nothing: that takes a tenth of a microsecond.
template <class Work>
void for_all_by_threads(std::size_t count, int threads, const Work& work, int share) {
  const auto end = static_cast<std::ptrdiff_t>(count);
  if (threads == 1 || end < 2) {
    for (std::ptrdiff_t i = 0; i < end; ++i) work(static_cast<std::size_t>(i), std::size_t{0});
    return;
  }
#pragma omp parallel for schedule(dynamic, share) num_threads(threads)
  for (std::ptrdiff_t i = 0; i < end; ++i)
    work(static_cast<std::size_t>(i), static_cast<std::size_t>(omp_get_thread_num()));
}

/// Calls work(i) for i < count, likewise.
template <class Work>
void for_all(std::size_t count, int threads, const Work& work, int share = 4) {
  for_all_by_threads(
      count, threads, [&](std::size_t i, std::size_t) { work(i); }, share);
}

}  // namespace exmat::runtime
