#pragma once

#include <Eigen/Core>

#include "common/model/reduced_model.h"

namespace exmat::runtime {

/// P_s = T^+ T [r x r], the low-pass filter of the shape space seen from the reduced space. docs/method.md, "Direct
/// projection". Symmetric where density is uniform; otherwise its skew part has no potential.
class ShapeFilter {
 public:
  ShapeFilter() = default;
  explicit ShapeFilter(const ProjectionData& projection);

  const Eigen::MatrixXd& matrix() const { return matrix_; }
  const Eigen::MatrixXd& symmetric_part() const { return symmetric_; }
  const Eigen::MatrixXd& skew_part() const { return skew_; }
  bool is_symmetric() const { return is_symmetric_; }

 private:
  Eigen::MatrixXd matrix_, symmetric_, skew_;
  bool is_symmetric_ = true;
};

/// The linear example force within one step, where qdot = c_v (q - q_v): f = -kappa (P_s q - g) - c_kappa P_s qdot
/// = -k P_s (q - q_c) + kappa g, g the pull of the target, k = kappa + c_kappa c_v, q_c = c_kappa c_v q_v / k.
/// docs/step_in_detail.md, "The incremental potential".
struct ExampleForce {
  double stiffness = 0;    ///< k > 0
  Eigen::VectorXd centre;  ///< q_c [r]
  Eigen::VectorXd pull;    ///< kappa g [r]
};

}  // namespace exmat::runtime
