#pragma once

#include <Eigen/Core>
#include <array>

#include "runtime/sim/solver/line_search.h"
#include "runtime/sim/space/full/full_space.h"
#include "runtime/sim/step/integrator.h"
#include "runtime/sim/step/scene.h"

namespace exmat::runtime {

/// Scratch of a FullPotential, sized once.
struct FullPotentialWorkspace {
  FullPotentialWorkspace() = default;
  explicit FullPotentialWorkspace(const FullSpace& space);

  Eigen::VectorXd start, offset, rate, external;         ///< fields at d = 0: q_n, q_n - q_a, q_n - q_v, f_ext
  Eigen::VectorXd unused;                                ///< a gradient that nobody asked for
  AlignedArray x, a, w, inertia, force;                  ///< fields at the last d
  AlignedArray frozen;                                   ///< tangents of damping, see Kernels::mesh_force()
  AlignedFloats tangents;                                ///< of the Hessian
  AlignedArray coefficients, target, rate_coefficients;  ///< 3 x stride: W^T u at the last d, c*, W^T q_v
};

/// What a step in full space minimises, a function of the field d = q - q_n:
///   c_a/2 (q - q_a)^T M (q - q_a) + E(q) - f_ext . d + c_v/2 (q - q_v)^T D (q - q_v)
///     + kappa/2 |W^T q - c*|^2 + c_kappa c_v/2 |W^T (q - q_v)|^2,
/// D = alpha M + beta K, K of the iterate that freeze() was last called at. Of a clamped body; of a free one without
/// damping and example force. Problem of search_line(). No call allocates.
class FullPotential {
 public:
  FullPotential(const FullSpace& space, const StepScene& scene, const StepForm& form, FullPotentialWorkspace& workspace)
      : space_(space), scene_(scene), form_(form), workspace_(workspace) {}

  /// Fields at d = 0 of the form's centres; q_n [f] and f_ext [f].
  void begin(const Eigen::VectorXd& q, const Eigen::VectorXd& external) noexcept;

  /// Inertia, elasticity and external force alone: at d = 0, of the elastic energy there, and at the last d.
  double undamped_at_start(double elastic_energy) noexcept;
  double undamped() const noexcept { return sums_[0] + sums_[2] - work_; }
  double elastic_energy() const noexcept { return sums_[2]; }

  enum class Tangents { kNone, kExact, kProjected };
  /// Elements at d, and tangents there; `freeze`: those of damping as well, before damping is evaluated.
  void evaluate_elements(const Eigen::VectorXd& d, Tangents tangents, bool freeze) noexcept;
  /// The gradient at the d of the last evaluate_elements(), with the target as it is now.
  PotentialEvaluation gradient_there(const Eigen::VectorXd& d, Eigen::VectorXd& gradient) noexcept;

  PotentialEvaluation evaluate(const Eigen::VectorXd& d, Eigen::VectorXd& gradient) noexcept {
    evaluate_elements(d, Tangents::kNone, false);
    return gradient_there(d, gradient);
  }
  PotentialValue value(const Eigen::VectorXd& d) noexcept { return evaluate(d, workspace_.unused).potential; }

  /// W^T q at the last d into the workspace's coefficients.
  void set_coefficients() noexcept;

 private:
  bool filters() const noexcept { return filter_stiffness() + filter_damping() > 0; }
  double filter_stiffness() const noexcept { return scene_.examples.empty() ? 0 : scene_.examples.front().stiffness; }
  double filter_damping() const noexcept {
    return scene_.examples.empty() ? 0 : scene_.examples.front().damping * form_.velocity_factor;
  }
  MeshInertia terms() const noexcept;

  const FullSpace& space_;
  const StepScene& scene_;
  const StepForm& form_;
  FullPotentialWorkspace& workspace_;
  std::array<double, kMeshSums> sums_{};
  double work_ = 0, external_norm_ = 0, reach_ = 0;
};

}  // namespace exmat::runtime
