#pragma once

#include "runtime/sim/frame/body_frame.h"

namespace exmat::runtime {

/// The frame of a free body: its centre of mass and the rotation that keeps its modes free of rigid motion, moved by
/// the body's momenta. docs/step_in_detail.md, "Free bodies".
class FreeFrame final : public BodyFrame {
 public:
  explicit FreeFrame(const RigidData& data) : inertia_(data) {}

  std::string_view description() const noexcept override {
    return "momenta, rotation by the spin that keeps the angular momentum";
  }
  Eigen::Vector3d origin() const noexcept override { return inertia_.centre_of_mass(); }
  Eigen::Vector3d centre_of_mass() const noexcept override { return inertia_.centre_of_mass(); }
  bool exerts_forces() const noexcept override { return true; }
  const DeformingInertia* inertia_of_momenta() const noexcept override { return &inertia_; }

  FrameState make_state() const override;
  FrameWorkspace make_workspace() const override { return FreeMotionWorkspace(inertia_); }
  void follow(const WorldLoads& loads, double time, const Eigen::VectorXd& q, const Eigen::VectorXd& v,
              FrameWorkspace& workspace, FrameState& state) const noexcept override;
  bool set_motion(const FrameMotion& motion, const Eigen::VectorXd& q, const Eigen::VectorXd& v,
                  FrameWorkspace& workspace, FrameState& state) const noexcept override;
  void adopt(const FrameMotion& motion, const FrameMomenta& momenta, const Eigen::VectorXd& q, const Eigen::VectorXd& v,
             FrameWorkspace& workspace, FrameState& state) const noexcept override;
  Placement placement(const FrameState& state) const noexcept override;
  FrameVelocity velocity(const FrameState& state) const noexcept override;
  FrameMotion motion(const FrameState& state) const noexcept override;
  std::optional<FrameMomenta> momenta(const FrameState& state) const noexcept override;
  double turn_rate(const FrameState& state) const noexcept override;
  const Eigen::VectorXd& momentum(const Eigen::VectorXd& v, const FrameState& state) const noexcept override;
  const Eigen::VectorXd& former_momentum(const Eigen::VectorXd& v_previous,
                                         const FrameState& state) const noexcept override;
  double kinetic_energy(const Eigen::VectorXd& v, const FrameState& state) const noexcept override;
  double potential_energy(const Eigen::Vector3d& gravity, const FrameState& state) const noexcept override;
  Coordinates coordinates(const FrameState& state) const noexcept override;
  /// The force and the torque of a host stand here among the numbers of a state.
  static constexpr std::size_t kFirstLoad = 16, kLoads = 6;
  std::size_t write_numbers(const FrameState& state, double* to) const noexcept override;
  void set_numbers(std::span<const double> numbers, FrameState& state) const noexcept override;
  void apply(const Eigen::Vector3d& force, const Eigen::Vector3d& torque, FrameState& state) const noexcept override;
  void clear_forces(FrameState& state) const noexcept override;
  Eigen::Vector3d limit_kinetic_energy(double allowed, const Eigen::Vector3d& impulse, FrameWorkspace& workspace,
                                       Eigen::VectorXd& v, FrameState& state) const noexcept override;
  void add_motion(double share, const FrameVelocity& added, FrameWorkspace& workspace, Eigen::VectorXd& v,
                  FrameState& state) const noexcept override;
  bool is_finite(const FrameWorkspace& workspace) const noexcept override;
  Eigen::Matrix3d inertia(const FrameWorkspace& workspace, const FrameState& state) const noexcept override;

  void begin(const FrameStep& step, FrameWorkspace& workspace, Eigen::VectorXd& external_force) const noexcept override;
  void move(const FrameStep& step, bool near, bool dissipative, const FrameState& state, FrameWorkspace& workspace,
            Eigen::VectorXd& external_force) const noexcept override;
  std::optional<FrameMomenta> expected_momenta(const FrameWorkspace& workspace) const noexcept override;
  void add_start_force(const FrameStep& step, const FrameState& state, FrameWorkspace& workspace,
                       Eigen::VectorXd& force) const noexcept override;
  bool update_force(const Eigen::VectorXd& q, double velocity_factor, const Eigen::VectorXd& velocity_centre,
                    FrameWorkspace& workspace) const noexcept override;
  const Eigen::VectorXd* force(const FrameWorkspace& workspace) const noexcept override;
  void add_stiffness(double velocity_factor, FrameWorkspace& workspace,
                     Eigen::MatrixXd& hessian) const noexcept override;
  double gyroscopic_ratio(double velocity_factor, const FrameWorkspace& workspace) const noexcept override;
  const Eigen::MatrixXd* gyroscopic(double velocity_factor, FrameWorkspace& workspace) const noexcept override;
  const Eigen::VectorXd* gyroscopic_product(double velocity_factor, const Eigen::VectorXd& x,
                                            FrameWorkspace& workspace) const noexcept override;
  bool fall_back(const FrameStep& step, FrameWorkspace& workspace) const noexcept override;
  void commit(const WorldLoads& loads, double rate, const Eigen::VectorXd& q, const Eigen::VectorXd& v,
              Eigen::VectorXd& a, FrameWorkspace& workspace, FrameState& state) const noexcept override;

  Eigen::Index rigid_unknowns() const noexcept override { return 6; }
  void begin_contact(const FrameState& state, const Eigen::VectorXd& q, double time_step, FrameWorkspace& workspace,
                     Eigen::VectorXd& x) const noexcept override;
  Placement place(const Eigen::VectorXd& x, FrameWorkspace& workspace) const noexcept override;
  Eigen::Matrix3d turn_to_world(const Eigen::VectorXd& x, const Placement& placement) const noexcept override;
  double rigid_potential(const Eigen::VectorXd& x, FrameWorkspace& workspace) const noexcept override;
  void rigid_gradient(const Eigen::VectorXd& x, const FrameMomenta& contact, FrameWorkspace& workspace,
                      Eigen::VectorXd& gradient) const noexcept override;
  double accept_rigid(FrameWorkspace& workspace) const noexcept override;
  void add_rigid_hessian(const Eigen::VectorXd& x, const Placement& placement, Eigen::MatrixXd& contact_stiffness,
                         FrameWorkspace& workspace, Eigen::MatrixXd& hessian) const noexcept override;
  Eigen::Vector3d force_of(const Eigen::VectorXd& x, const FrameWorkspace& workspace) const noexcept override;
  double residual_of(const Eigen::Vector3d& force) const noexcept override;
  void end_contact(const Eigen::VectorXd& x, bool converged, const Eigen::Vector3d& torque, const FrameState& state,
                   FrameWorkspace& workspace, Eigen::Vector3d& force) const noexcept override;

 private:
  DeformingInertia inertia_;
};

}  // namespace exmat::runtime
