#include "common/bundle/table_checks.h"

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

}  // namespace exmat
