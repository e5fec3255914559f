#include "runtime/bench/dgemm_rate.h"

#include <algorithm>

#include "common/core/timer.h"

namespace exmat::runtime {
namespace {

constexpr std::ptrdiff_t kSize = 10 * kGemmMultiple;
constexpr double kFlops = 2.0 * kSize * kSize * kSize;

AlignedArray small_numbers() {
  AlignedArray numbers(kSize * kSize);
  for (std::ptrdiff_t i = 0; i < numbers.size(); ++i) numbers[i] = 1e-3 * static_cast<double>(i % 17 - 8);
  return numbers;
}

}  // namespace

DgemmRate::DgemmRate(const Kernels& kernels)
    : kernels_(kernels), a_(small_numbers()), b_(small_numbers()), c_(kSize * kSize) {}

void DgemmRate::measure(int count) {
  kernels_.gemm(kSize, a_.data(), b_.data(), c_.data());
  for (int i = 0; i < count; ++i) {
    const Timer timer;
    kernels_.gemm(kSize, a_.data(), b_.data(), c_.data());
    const double rate = kFlops / timer.seconds();
    rates_.add(rate);
    best_ = std::max(best_, rate);
  }
}

}  // namespace exmat::runtime
