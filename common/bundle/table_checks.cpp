#include "common/bundle/table_checks.h"

#include <Eigen/LU>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <string>
#include <utility>

namespace exmat {
namespace {

using IntegerRow = Eigen::Matrix<std::int64_t, 1, Eigen::Dynamic>;

// Makes it the next smaller one of the same sum; false where there is none.
bool descend(IntegerRow& row) {
  const Eigen::Index last = row.size() - 1;
  Eigen::Index i = last - 1;
  while (i >= 0 && row[i] == 0) --i;
  if (i < 0) return false;
  --row[i];
  const std::int64_t rest = std::exchange(row[last], 0);
  row[i + 1] = rest + 1;
  return true;
}

std::string text_of(const IntegerRow& row) { return fmt::format("{}", fmt::join(row.begin(), row.end(), " ")); }

}  // namespace

std::optional<ValueFault> check_exponent_rows(std::int64_t degree, const IndexMatrix& rows) {
  IntegerRow expected = IntegerRow::Zero(rows.cols());
  expected[0] = degree;
  bool more = true;
  for (Eigen::Index i = 0; i < rows.rows(); ++i) {
    const IntegerRow row = rows.row(i).cast<std::int64_t>();
    if (!more) return ValueFault{fmt::format("{} rows for degree {}", i, degree), fmt::format("{}", rows.rows())};
    if (row != expected)
      return ValueFault{fmt::format("{} in row {}, for degree {}", text_of(expected), i, degree), text_of(row)};
    more = descend(expected);
  }
  if (more) return ValueFault{fmt::format("a row {} after the last, for degree {}", text_of(expected), degree), "none"};
  return std::nullopt;
}

std::optional<ValueFault> check_knots(const Eigen::VectorXd& knots, Eigen::Index examples) {
  const Eigen::Index last = knots.size() - 1;
  if (last < 1 || (last > 1 && examples != 2))
    return ValueFault{fmt::format("2 knots for {} examples", examples), fmt::format("{}", knots.size())};
  if (knots[0] != 0) return ValueFault{"0 at [0]", fmt::format("{}", knots[0])};
  if (knots[last] != 1) return ValueFault{fmt::format("1 at [{}]", last), fmt::format("{}", knots[last])};
  return std::nullopt;
}

std::optional<PlacedFault> skeleton_fault(const SkeletonData& skeleton) {
  constexpr double kRounding = 1e-9;
  const Eigen::Index bones = skeleton.parents.size(), frames = skeleton.times.size();
  if (std::ssize(skeleton.bones) != bones)
    return PlacedFault{"/skeleton@bones", fmt::format("{} names", bones), std::to_string(skeleton.bones.size())};
  for (Eigen::Index b = 0; b < bones; ++b) {
    if (skeleton.parents[b] < -1 || skeleton.parents[b] >= b)
      return PlacedFault{"/skeleton/parents", fmt::format("for bone {} a bone before it, or -1", b),
                         std::to_string(skeleton.parents[b])};
    if (!(std::abs(skeleton.bind.block<3, 3>(3 * b, 0).determinant()) > 0))
      return PlacedFault{"/skeleton/bind", "axes of bones that can be inverted", fmt::format("others for bone {}", b)};
  }
  for (Eigen::Index v = 0; v < skeleton.weights.rows(); ++v)
    if (std::abs(skeleton.weights.row(v).sum() - 1) > kRounding)
      return PlacedFault{"/skeleton/weights", fmt::format("numbers that add up to 1 in row {}", v),
                         fmt::format("{}", skeleton.weights.row(v).sum())};
  const IndexVector& first = skeleton.first_frames;
  if (first.size() != std::ssize(skeleton.animations) + 1)
    return PlacedFault{"/skeleton@animations", fmt::format("{} names", first.size() - 1),
                       std::to_string(skeleton.animations.size())};
  const bool ascend = (first.head(first.size() - 1).array() < first.tail(first.size() - 1).array()).all();
  if (!ascend || first[0] != 0 || first[first.size() - 1] != frames)
    return PlacedFault{"/skeleton/first_frames", fmt::format("numbers that ascend from 0 to {}", frames), "others"};
  for (Eigen::Index a = 0; a + 1 < first.size(); ++a)
    for (Eigen::Index f = first[a]; f + 1 < first[a + 1]; ++f)
      if (skeleton.times[f] >= skeleton.times[f + 1])
        return PlacedFault{"/skeleton/times", "times that ascend in each animation", fmt::format("others at {}", f)};
  for (Eigen::Index k = 0; k < skeleton.poses.rows(); ++k)
    if (std::abs(skeleton.poses.row(k).tail(4).norm() - 1) > kRounding)
      return PlacedFault{"/skeleton/poses", fmt::format("a unit quaternion in row {}", k),
                         fmt::format("one of length {}", skeleton.poses.row(k).tail(4).norm())};
  return std::nullopt;
}

}  // namespace exmat
