#include "runtime/sim/step/vertex_positions.h"

#include <array>
#include <cmath>
#include <gtest/gtest.h>
#include <vector>

#include "tests/support/allocation_counter.h"
#include "tests/support/random.h"
#include "tests/support/synthetic_model.h"

namespace exmat::runtime {
namespace {

using test::AllocationCounter;

constexpr std::array kSets{InstructionSet::kPortable, InstructionSet::kAvx2, InstructionSet::kAvx512};
constexpr float kUntouched = -12345;

/// The largest error over its bound. Nothing is allocated, and no float written after the last one.
double error_over_bound(const VertexArray& rest, const RowMatrix& basis, const Eigen::VectorXd& q,
                        const Kernels& instructions) {
  const VertexPositions positions(rest, basis);
  VertexPositions::Workspace workspace = VertexPositions::make_workspace(basis.cols());
  const Eigen::Index floats = 3 * rest.rows();
  std::vector<float> xyz(static_cast<std::size_t>(floats + 16), kUntouched);
  const AllocationCounter counter;
  positions.evaluate(q, workspace, xyz.data(), instructions);
  const std::size_t allocations = counter.count();
  EXPECT_EQ(AllocationCounter::works() ? allocations : 0, 0u);
  for (std::size_t i = static_cast<std::size_t>(floats); i < xyz.size(); ++i) EXPECT_EQ(xyz[i], kUntouched);

  const double u = std::ldexp(1.0, -24), r = static_cast<double>(basis.cols());
  const Eigen::VectorXd exact = rest.reshaped<Eigen::RowMajor>() + basis * q;
  const Eigen::VectorXd moved = basis.cwiseAbs() * q.cwiseAbs();
  double worst = 0;
  for (Eigen::Index i = 0; i < floats; ++i) {
    // Rounding of the displacement: each term is a product of two rounded numbers and is in at most r additions; of the
    // sum: the rest position is rounded, and so is the last addition. The factor takes in the terms in u^2.
    const double rest_size = std::abs(rest(i / 3, i % 3));
    const double bound = 1.001 * u * ((r + 3) * moved[i] + rest_size + std::abs(exact[i]));
    worst = std::max(worst, std::abs(xyz[static_cast<std::size_t>(i)] - exact[i]) / bound);
  }
  return worst;
}

TEST(VertexPositionsTest, AreThoseOfDoublePrecisionToTheBound) {
  for (const InstructionSet set : kSets) {
    const Kernels* const instructions = kernels_for(set);
    if (instructions == nullptr) continue;
    for (const Eigen::Index points : {1, 5, 6, 1000})
      for (const Eigen::Index modes : {0, 1, 7, 20, 64}) {
        const VertexArray rest = 10 * test::random_matrix(points, 3, 1);
        const RowMatrix basis = test::random_matrix(3 * points, modes, 2);
        const Eigen::VectorXd q = 0.1 * test::random_vector(modes, 3);
        EXPECT_LE(error_over_bound(rest, basis, q, *instructions), 1)
            << instructions->name << ", " << points << " points, " << modes << " modes";
      }
  }
}

TEST(VertexPositionsTest, OfABarFarFromTheOriginLoseNoMoreThanItsCoordinatesDo) {
  const test::Bar bar = test::make_bar();
  VertexArray rest = bar.model.object->mesh.vertices;
  rest.col(0).array() += 1000;
  const Eigen::VectorXd q = 0.05 * test::random_vector(bar.modes(), 4);
  const VertexPositions positions(rest, bar.basis());
  VertexPositions::Workspace workspace = VertexPositions::make_workspace(bar.modes());
  std::vector<float> xyz(static_cast<std::size_t>(rest.size()));
  positions.evaluate(q, workspace, xyz.data());
  const Eigen::VectorXd exact = rest.reshaped<Eigen::RowMajor>() + bar.basis() * q;
  const Eigen::VectorXd error = Eigen::Map<const Eigen::VectorXf>(xyz.data(), exact.size()).cast<double>() - exact;
  // Half a unit in the last place of 1000 m is 3.1e-5 m, once for the rest position and once for the sum.
  EXPECT_LE(error.cwiseAbs().maxCoeff(), 6.2e-5);
  for (const InstructionSet set : kSets)
    if (const Kernels* const instructions = kernels_for(set)) {
      EXPECT_LE(error_over_bound(rest, bar.basis(), q, *instructions), 1) << instructions->name;
    }
}

TEST(VertexPositionsTest, OfNoPointWriteNothing) {
  EXPECT_EQ(error_over_bound(VertexArray(0, 3), RowMatrix(0, 4), Eigen::VectorXd::Ones(4), kernels()), 0);
}

}  // namespace
}  // namespace exmat::runtime
