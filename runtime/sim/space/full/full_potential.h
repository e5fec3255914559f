#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <limits>
#include <span>

#include "runtime/sim/solver/line_search.h"
#include "runtime/sim/space/full/full_model.h"
#include "runtime/sim/step/integrator.h"
#include "runtime/sim/step/scene.h"
#include "runtime/sim/step/state.h"

namespace exmat::runtime {

inline constexpr double kPlaceRounding =
    4 * std::numeric_limits<double>::epsilon();  ///< relative error of a vertex's place

/// Scratch of a FullPotential, sized once.
struct FullPotentialWorkspace {
  FullPotentialWorkspace() = default;
  explicit FullPotentialWorkspace(const FullModel& model);

  Eigen::VectorXd start, offset, rate, external;  ///< fields at d = 0: q_n, q_n - q_a, q_n - q_v, f_ext
  Eigen::VectorXd frame_rate;            ///< q - q_v that the frame of a carried body makes, or the bones alone
  SkinPose skin;                         ///< pose by the bones at the end of the step, on a skeleton
  Eigen::VectorXd turned;                ///< a field in its bones' axes, or of a free body a force
  Eigen::VectorXd unused;                ///< a gradient that nobody asked for
  AlignedArray x, a, w, inertia, force;  ///< fields at the last d
  AlignedArray beside;                   ///< x less that of a vertex, where that is far
  AlignedArray frozen;                   ///< tangents of damping, see Kernels::mesh_force()
  AlignedFloats tangents;                ///< element tangents for the Hessian
  AlignedArray lines;                    ///< scratch of the kernels
  /// F^T q at the last d, F^T (q - q_v), four numbers of each function; forces on them.
  AlignedArray coefficients, rate_coefficients;
  Eigen::VectorXd target;               ///< c* of each group [3m] from 3 `first` on
  Eigen::VectorXd raw, spring, damper;  ///< numbers of one group
  FullTarget elastic_target;            ///< targets of elastic example forces
  RigidWorkspace rigid;                 ///< pose of a free body where freeze() was last called
};

/// Takes off a field [places x 4] what would move what attachments hold, and calls use(attachment, k, taken) with that
/// of each vertex k of a fixed one and, once, of the mean of a ball.
template <typename Number, typename Use>
void project_held(const FullSpace& space, std::span<Attachment> attachments, Number* field, const Use& use) noexcept {
  using Vector = Eigen::Matrix<Number, 3, 1>;
  for (Attachment& attachment : attachments) {
    if (!attachment.holds() || attachment.kind == AttachmentKind::kSpring) continue;
    const auto at = [&](std::size_t k) { return Eigen::Map<Vector>(field + 4 * space.place(attachment.vertices[k])); };
    if (attachment.kind == AttachmentKind::kFixed) {
      for (std::size_t k = 0; k < attachment.vertices.size(); ++k) {
        use(attachment, static_cast<Eigen::Index>(k), Vector(at(k)));
        at(k).setZero();
      }
      continue;
    }
    const auto shares = attachment.shares.cast<Number>().eval();
    Vector mean = Vector::Zero();
    for (std::size_t k = 0; k < attachment.vertices.size(); ++k) mean += shares[static_cast<Eigen::Index>(k)] * at(k);
    mean /= shares.squaredNorm();
    use(attachment, 0, mean);
    for (std::size_t k = 0; k < attachment.vertices.size(); ++k) at(k) -= shares[static_cast<Eigen::Index>(k)] * mean;
  }
}

template <typename Number>
void project_held(const FullSpace& space, std::span<Attachment> attachments, Number* field) noexcept {
  project_held(space, attachments, field, [](const Attachment&, Eigen::Index, const auto&) {});
}

/// Potential that a step in full space minimises, a function of the field d = q - q_n:
///   c_a/2 (q - q_a)^T M (q - q_a) + E(q) - f_ext . d + c_v/2 (q - q_v)^T D (q - q_v)
///     + sum kappa/2 |W^T q - c*|^2 + c_kappa c_v/2 |W^T (q - q_v)|^2
/// over the examples, of a region what it sees of q (FullExamples), of an elastic example force its energy, once there
/// is a target, in place of the term with kappa;
/// D = alpha M + beta K, K of the iterate that was last frozen, and with obstacles near their potential. Of a free body
/// q - q_v is that without the rigid motion that has its momenta, of a carried one without that of its frame, as the
/// body stands at that iterate; and W^T q - c* of a free body is that of its deformation in the frame that fits it at
/// d. Problem of search_line(). No call allocates.
class FullPotential {
 public:
  FullPotential(const FullModel& model, const StepScene& scene, const StepForm& form, FullPotentialWorkspace& workspace)
      : model_(model), space_(model.space), scene_(scene), form_(form), workspace_(workspace) {}

  /// Obstacles are near: their candidates after FullContacts::begin().
  void set_contact(ContactWorkspace* contact) noexcept { contact_ = contact; }

  /// Fields at d = 0 of the form's centres; q_n [f] and f_ext [f].
  void begin(const Eigen::VectorXd& q, const Eigen::VectorXd& external) noexcept;

  /// After begin(): what a host holds. Gradients are then those of what it leaves free, and evaluations set the loads.
  void set_attachments(std::span<Attachment> attachments) noexcept;
  /// Their springs: `image` += K `field`.
  void add_springs(const float* field, float* image) const noexcept;

  /// After begin(), of a carried body: where its frame was and is to be.
  void drive(const MotionSample& from, const MotionSample& to) noexcept;

  /// After begin(), of a body on a skeleton, the workspace's skin at the end of the step and its fixed vertices where
  /// they are in `start`: these have a form of their own, and the bones alone make this way [field] in the step, and
  /// made `way_previous` [f] in the one before, which counts where the form is of second order.
  void hang(const SkeletonMotion& bones, const StepForm& fixed, const Eigen::VectorXd& way, bool second_order) noexcept;

  /// Inertia, elasticity and external force alone: at `d`, of the elastic energy there, and at the last d.
  double undamped_at(const Eigen::VectorXd& d, double elastic_energy) noexcept;
  double undamped() const noexcept { return sums_[0] + sums_[2] - work_; }
  double elastic_energy() const noexcept { return sums_[2]; }

  enum class Tangents { kNone, kExact, kProjected };
  /// Elements at d, and tangents there; `freeze`: those of damping as well, before damping is evaluated.
  void evaluate_elements(const Eigen::VectorXd& d, Tangents tangents, bool freeze) noexcept;
  /// Places the frame of a free body at d: damping takes off rigid motion by it from now on. Where d is far from the
  /// frame the gradient is not that of the potential, since forces of damping have no torque about the body as it is.
  void place_frame(const Eigen::VectorXd& d) noexcept {
    workspace_.turned = workspace_.start + d;
    model_.rigid->place(workspace_.turned.data(), workspace_.rigid);
  }
  /// The gradient at the d of the last evaluate_elements(), with the target as it is now.
  PotentialEvaluation gradient_there(const Eigen::VectorXd& d, Eigen::VectorXd& gradient) noexcept;

  PotentialEvaluation evaluate(const Eigen::VectorXd& d, Eigen::VectorXd& gradient) noexcept {
    evaluate_elements(d, Tangents::kNone, false);
    return gradient_there(d, gradient);
  }
  PotentialValue value(const Eigen::VectorXd& d) noexcept { return evaluate(d, workspace_.unused).potential; }

  /// F^T q at the last d into the workspace's coefficients; of a body whose frame moves that of its deformation.
  void set_coefficients() noexcept;
  /// What a group [3m] sees of them.
  void see(const FullExamples& examples, Eigen::VectorXd& seen) noexcept;
  /// The shape [field] of no energy of an elastic example force of a group; before the next evaluate_elements().
  void set_elastic_target(std::size_t group, const Eigen::VectorXd& shape) noexcept;
  bool has_elastic_target() const noexcept { return has_elastic_target_; }
  bool has_moving_frame() const noexcept { return model_.rigid || model_.carried; }
  /// From the frame of the deformations that example forces see to the world, as damping has it in this step.
  const Eigen::Matrix3d& frame_rotation() const noexcept {
    return model_.rigid ? workspace_.rigid.rotation : frame_.rotation;
  }

 private:
  bool filters() const noexcept { return std::ranges::any_of(scene_.examples, is_filtered); }
  bool damps_filtered() const noexcept {
    return std::ranges::any_of(scene_.examples, [](const ExampleSettings& own) { return own.damping > 0; });
  }
  MeshInertia terms() const noexcept;
  const double* near_field() noexcept;

  /// The coefficient of one function.
  static Eigen::Map<Eigen::Vector3d> at(AlignedArray& coefficients, Eigen::Index k) noexcept {
    return Eigen::Map<Eigen::Vector3d>(coefficients.data() + 4 * k);
  }
  void see(const FullExamples& examples, AlignedArray& coefficients, const Eigen::Matrix3d* from,
           Eigen::VectorXd& seen) noexcept;
  void put_force(const FullExamples& examples, Eigen::VectorXd& force, const Eigen::Matrix3d* to,
                 AlignedArray& coefficients) noexcept;
  void set_filter_coefficients(PotentialValue& total) noexcept;
  void add_group(std::size_t group, PotentialValue& total) noexcept;
  void add_filter_force(Eigen::VectorXd& gradient) noexcept;
  void add_contacts(PotentialEvaluation& evaluation, Eigen::VectorXd& gradient) noexcept;
  void remove_host_motion(bool freeze) noexcept;
  void add_attachments(PotentialEvaluation& evaluation, Eigen::VectorXd& gradient) noexcept;
  bool damps() const noexcept { return scene_.mass_damping > 0 || scene_.stiffness_damping > 0 || damps_filtered(); }

  const FullModel& model_;
  const FullSpace& space_;
  const StepScene& scene_;
  const StepForm& form_;
  FullPotentialWorkspace& workspace_;
  ContactWorkspace* contact_ = nullptr;
  std::span<Attachment> attachments_;
  const Attachment* host_ = nullptr;                     ///< the first that holds
  Eigen::Vector3d host_turn_ = Eigen::Vector3d::Zero();  ///< in q - q_v
  RigidPart::Turn turn_;                                 ///< turn of a free body, at the last coefficients
  FrameOfFunctions::Frame examples_frame_;               ///< frame of those, where it moves
  MotionSample frame_;                                   ///< at the end of the step, of a carried body
  std::array<double, kMeshSums> sums_{};
  double work_ = 0, external_norm_ = 0, reach_ = 0;
  const double* elements_at_ = workspace_.x.data();  ///< displacements that elements see
  bool has_elastic_target_ = false;
  bool coefficients_stand_ = false;  ///< true where the workspace has those of the last d
};

}  // namespace exmat::runtime
