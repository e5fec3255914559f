// Any text is bones of a mesh of a dozen vertices or refused.
#include <cmath>

#include "common/core/error.h"
#include "precompute/inputs/skeleton_file.h"
#include "tests/fuzz/fuzz_target.h"

namespace exmat {
namespace {

constexpr Eigen::Index kVertices = 12;

void require(bool condition) {
  if (!condition) __builtin_trap();
}

// Requires what the reader promises: numbers are finite, weights add up to 1 or 0, bones follow what they hang on.
void check(const SkeletonData& skeleton) {
  const auto bones = std::ssize(skeleton.bones);
  require(bones > 0 && skeleton.parents.size() == bones);
  for (Eigen::Index b = 0; b < bones; ++b) require(skeleton.parents[b] >= -1 && skeleton.parents[b] < b);
  require(skeleton.bind.rows() == 3 * bones && skeleton.bind.allFinite());
  require(skeleton.weights.rows() == kVertices && skeleton.weights.cols() == bones);
  require(skeleton.weights.allFinite() && skeleton.weights.minCoeff() >= 0);
  for (const double sum : skeleton.weights.rowwise().sum()) require(sum == 0 || std::abs(sum - 1) < 1e-12);
  require(skeleton.first_frames.size() == std::ssize(skeleton.animations) + 1);
  require(skeleton.poses.rows() == bones * skeleton.times.size() && skeleton.poses.allFinite());
  require(skeleton.times.allFinite());
}

}  // namespace
}  // namespace exmat

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace exmat;
  const auto file = fuzz::input_file(".json", {reinterpret_cast<const char*>(data), size});
  try {
    check(precompute::read_skeleton(file, kVertices));
  } catch (const InputError&) {
  }
  return 0;
}
