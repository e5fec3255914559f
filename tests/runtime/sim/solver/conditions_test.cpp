#include "runtime/sim/solver/conditions.h"

#include <cmath>
#include <gtest/gtest.h>

namespace exmat::runtime {
namespace {

/// atan(x) = 0, which the tangent at |x| > 1.39 leads away from, farther in each iteration.
struct Arc {
  Arc() {
    conditions.resize(1);
    conditions.blocks.push_back({0, 0, Eigen::MatrixXd::Ones(1, 1), Eigen::MatrixXd::Ones(1, 1)});
  }
  bool hold(double start) {
    x = Eigen::VectorXd::Constant(1, start);
    return conditions.hold(x, [this](const Eigen::VectorXd& at) {
      conditions.violation[0] = std::atan(at[0]);
      conditions.blocks.front().gradients(0, 0) = 1 / (1 + at[0] * at[0]);
      return 0.0;
    });
  }

  Conditions conditions;
  Eigen::VectorXd x;
};

TEST(Conditions, SaysWhetherItCameToThem) {
  Arc arc;
  EXPECT_TRUE(arc.hold(0.5));
  EXPECT_LE(std::abs(arc.x[0]), 1e-14);
  EXPECT_FALSE(arc.hold(3));
}

// A return that began with the factor of the last one would end elsewhere.
TEST(Conditions, EndWhereTheBeginningLeads) {
  Arc fresh, used;
  EXPECT_FALSE(used.hold(3));
  EXPECT_EQ(used.hold(0.7), fresh.hold(0.7));
  EXPECT_EQ(used.x, fresh.x);
}

}  // namespace
}  // namespace exmat::runtime
