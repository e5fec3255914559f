#include "common/bundle/table_checks.h"

#include <Eigen/LU>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <string>
#include <utility>

namespace exmat {
namespace {

constexpr double kRounding = 1e-9;  // of a sum, or a length, that is 1

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

// Terms of one and two examples in ascending order, behind the row of the constant: of a term of degree n all rows
// that add up to n and are positive at its examples, 0 at others but the first.
std::optional<ValueFault> check_pair_rows(std::int64_t degree, const IndexMatrix& rows) {
  using Members = std::pair<Eigen::Index, Eigen::Index>;  // the second one 0 where there is none
  const auto members = [&](Eigen::Index i) -> std::optional<Members> {
    Members found{0, 0};
    for (Eigen::Index k = 1; k < rows.cols(); ++k) {
      if (rows(i, k) == 0) continue;
      if (found.second > 0) return std::nullopt;
      (found.first == 0 ? found.first : found.second) = k;
    }
    return found.first > 0 ? std::optional(found) : std::nullopt;
  };
  const auto comes_before = [](const Members& a, const Members& b) {
    return std::pair(a.second > 0, a) < std::pair(b.second > 0, b);
  };
  Members last{0, 0};
  for (Eigen::Index i = 1; i < rows.rows();) {
    const std::optional<Members> own = members(i);
    const std::int64_t sum = rows.row(i).cast<std::int64_t>().sum();
    if (!own || !comes_before(last, *own) || sum > degree)
      return ValueFault{
          fmt::format("one or two examples behind those of the row before, to at most {}, in row {}", degree, i),
          text_of(rows.row(i).cast<std::int64_t>())};
    last = *own;
    const std::int64_t pair = own->second > 0 ? 1 : 0;
    for (std::int64_t a = 1; a <= sum - pair; ++a)
      for (std::int64_t b = pair; b <= pair * (sum - a); ++b, ++i) {
        IntegerRow expected = IntegerRow::Zero(rows.cols());
        expected[0] = sum - a - b;
        expected[own->first] = a;
        if (pair > 0) expected[own->second] = b;
        if (i == rows.rows()) return ValueFault{fmt::format("a row {} after the last", text_of(expected)), "none"};
        const IntegerRow row = rows.row(i).cast<std::int64_t>();
        if (row != expected) return ValueFault{fmt::format("{} in row {}", text_of(expected), i), text_of(row)};
      }
  }
  return std::nullopt;
}

}  // namespace

std::optional<ValueFault> check_exponent_rows(std::int64_t degree, const IndexMatrix& rows) {
  if (is_of_pairs(rows)) return check_pair_rows(degree, rows);
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

std::optional<PlacedFault> bone_weights_fault(const std::string& place, const RowMatrix& weights) {
  if (weights.cols() == 0) return std::nullopt;
  for (Eigen::Index v = 0; v < weights.rows(); ++v)
    if (std::abs(weights.row(v).sum() - 1) > kRounding)
      return PlacedFault{place, fmt::format("numbers that add up to 1 in row {}", v),
                         fmt::format("{}", weights.row(v).sum())};
  return std::nullopt;
}

std::optional<PlacedFault> skeleton_fault(const SkeletonData& skeleton) {
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
  if (auto fault = bone_weights_fault("/skeleton/weights", skeleton.weights)) return fault;
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
