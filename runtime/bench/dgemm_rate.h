#pragma once

#include "runtime/kernels/aligned_array.h"
#include "runtime/kernels/kernels.h"
#include "runtime/scene/samples.h"

namespace exmat::runtime {

/// The most that this machine can reach in one thread: the rate of a product of two dense matrices by Kernels::gemm,
/// 240 x 240 in double precision, packed beforehand and at home in the second-level cache.
class DgemmRate {
 public:
  explicit DgemmRate(const Kernels& kernels = runtime::kernels());

  /// Times `count` products, after one that is not timed.
  void measure(int count = 4);

  double best() const { return best_; }                   ///< [flop/s], of all products so far
  double median() const { return rates_.quantile(0.5); }  ///< [flop/s], likewise

 private:
  const Kernels& kernels_;
  AlignedArray a_, b_, c_;
  Samples rates_;
  double best_ = 0;
};

}  // namespace exmat::runtime
