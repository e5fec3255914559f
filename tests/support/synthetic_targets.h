#pragma once

#include "common/model/reduced_model.h"
#include "runtime/sim/examples/bernstein_basis.h"

namespace exmat::test {

/// A table of the targets sum_k w_k p_k, which the Bernstein form of any degree has exactly: P_a = sum_k a_k / D p_k.
inline TargetTableData linear_targets(const std::vector<ExampleData>& examples, int degree) {
  const auto count = static_cast<int>(examples.size());
  TargetTableData data;
  data.degree = degree;
  data.exponents = runtime::BernsteinBasis(degree, count).exponents();
  data.control_points = RowMatrix::Zero(data.exponents.rows(), examples.front().pose.size());
  for (int k = 0; k < count; ++k)
    data.control_points += data.exponents.col(k).cast<double>() / degree * examples[k].pose.transpose();
  data.energy_reference = EnergyReference::kExample;
  return data;
}

}  // namespace exmat::test
