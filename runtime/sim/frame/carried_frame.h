#pragma once

#include "runtime/sim/frame/body_frame.h"

namespace exmat::runtime {

/// The frame of a body whose fixed part a prescribed motion carries: that motion. Its equations are in
/// carried_motion.h.
class CarriedFrame final : public BodyFrame {
 public:
  /// `data` with spin_load; gravity_load [3 x r].
  CarriedFrame(const RigidData& data, RowMatrix gravity_load)
      : inertia_{DeformingInertia(data), data.spin_load}, gravity_load_(std::move(gravity_load)) {}

  std::string_view description() const noexcept override {
    return "prescribed, with the inertial forces that it causes";
  }
  Eigen::Vector3d centre_of_mass() const noexcept override { return inertia_.moments.centre_of_mass(); }
  bool exerts_forces() const noexcept override { return true; }
  bool is_driven() const noexcept override { return true; }

  FrameState make_state() const override { return CarriedState(); }
  FrameWorkspace make_workspace() const override { return CarriedWorkspace(inertia_); }
  void follow(const WorldLoads& loads, double time, const Eigen::VectorXd& q, const Eigen::VectorXd& v,
              FrameWorkspace& workspace, FrameState& state) const noexcept override;
  Placement placement(const FrameState& state) const noexcept override;
  FrameVelocity velocity(const FrameState& state) const noexcept override;
  FrameMotion motion(const FrameState& state) const noexcept override;
  double turn_rate(const FrameState& state) const noexcept override;
  double kinetic_energy(const Eigen::VectorXd& v, const FrameState& state) const noexcept override;
  double potential_energy(const Eigen::Vector3d& gravity, const FrameState& state) const noexcept override;
  std::size_t write_numbers(const FrameState& state, double* to) const noexcept override;
  void set_numbers(std::span<const double> numbers, FrameState& state) const noexcept override;

  void begin(const FrameStep& step, FrameWorkspace& workspace, Eigen::VectorXd& external_force) const noexcept override;
  FrameVelocity expected_velocity(const FrameState& state, const FrameWorkspace& workspace) const noexcept override;
  bool jumps(const WorldLoads& loads, double from, double to) const noexcept override;
  void enter_start(const FrameStep& step, FrameWorkspace& workspace,
                   Eigen::VectorXd& external_force) const noexcept override;
  void add_start_force(const FrameStep& step, const FrameState& state, FrameWorkspace& workspace,
                       Eigen::VectorXd& force) const noexcept override;
  void leave_start(const FrameStep& step, FrameWorkspace& workspace,
                   Eigen::VectorXd& external_force) const noexcept override;
  bool update_force(const Eigen::VectorXd& q, double velocity_factor, const Eigen::VectorXd& velocity_centre,
                    FrameWorkspace& workspace) const noexcept override;
  const Eigen::VectorXd* force(const FrameWorkspace& workspace) const noexcept override;
  void add_stiffness(double velocity_factor, FrameWorkspace& workspace,
                     Eigen::MatrixXd& hessian) const noexcept override;
  double gyroscopic_ratio(double velocity_factor, const FrameWorkspace& workspace) const noexcept override;
  const Eigen::MatrixXd* gyroscopic(double velocity_factor, FrameWorkspace& workspace) const noexcept override;
  const Eigen::VectorXd* gyroscopic_product(double velocity_factor, const Eigen::VectorXd& x,
                                            FrameWorkspace& workspace) const noexcept override;
  void commit(const WorldLoads& loads, double rate, const Eigen::VectorXd& q, const Eigen::VectorXd& v,
              Eigen::VectorXd& a, FrameWorkspace& workspace, FrameState& state) const noexcept override;
  Placement place(const Eigen::VectorXd& x, FrameWorkspace& workspace) const noexcept override;

 private:
  void take(const FrameStep& step, const MotionSample& sample, FrameWorkspace& workspace,
            Eigen::VectorXd& external_force) const noexcept;

  CarriedInertia inertia_;
  RowMatrix gravity_load_;
};

}  // namespace exmat::runtime
