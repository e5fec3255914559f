#pragma once

#include <Eigen/Core>

namespace exmat::runtime {

/// State that an integrator continues; [r] each. Refers to a state.
struct StepHistory {
  const Eigen::VectorXd &q, &v, &q_previous;
  const Eigen::VectorXd &momentum, &momentum_previous;  ///< BodyFrame::momentum(); v where the frame stands still
};

/// An implicit integrator within one step: v = c_v (q - q_v), a = c_a (q - q_a) at the end of the step.
/// docs/step_in_detail.md, "Integrators". For a free body a is the rate of change of its momentum pi as far as pi is
/// qdot: the centres then come from pi where those of a constrained body come from v.
struct StepForm {
  double velocity_factor = 0;                            ///< c_v [1/s]
  double acceleration_factor = 0;                        ///< c_a [1/s^2]
  Eigen::VectorXd velocity_centre, acceleration_centre;  ///< q_v, q_a [r]
};

/// Backward Euler: h = dt, q_hat = q_n, v_hat = v_n; c_v = 1/h, q_v = q_hat, c_a = 1/h^2, q_a = q_hat + h v_hat.
void backward_euler_form(const StepHistory& history, double time_step, StepForm& form) noexcept;

/// BDF2 as backward Euler with h = 2 dt/3, q_hat = (4 q_n - q_{n-1})/3, v_hat likewise.
void bdf2_form(const StepHistory& history, double time_step, StepForm& form) noexcept;

/// Newmark, beta 1/4, gamma 1/2 (Newmark 1959), from the acceleration a_n `acceleration` [r] at the beginning of the
/// step: that of q, or of a free body's pi.
void newmark_form(const StepHistory& history, const Eigen::VectorXd& acceleration, double time_step,
                  StepForm& form) noexcept;

}  // namespace exmat::runtime
